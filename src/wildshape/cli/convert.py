# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape convert`: data sets as they lie on disk become tracks."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Layout, Overwrite, Unit
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.cli.reading import Reading
    from wildshape.datasets.source import Source
    from wildshape.records import Track

EXAMPLE = "wildshape convert kitti-raw 2011_09_26 cars.store"

Name = Annotated[
    str, Positional, arg(metavar="SOURCE", help="kitti-raw, folder (track folders) or packed")
]
Root = Annotated[Path, Positional, arg(metavar="ROOT", help="where it lies")]
Out = Annotated[Path, Positional, arg(metavar="OUT", help="packed store, or folder, to write")]


@dataclass(frozen=True)
class Settings:
    """Convert a data set into tracks: the crops of each object over time, with truth if known.

    Attributes:
        min_points: a scan with fewer points on the object is left out (kitti-raw).
        min_scans: an object with fewer scans is left out (kitti-raw).
        every: take every k-th frame (kitti-raw).
    """

    source: Name
    root: Root
    out: Out
    layout: Layout = "packed"
    unit: Unit = "m"
    min_points: Annotated[int, arg(metavar="N")] = 100
    min_scans: Annotated[int, arg(metavar="N")] = 1
    every: Annotated[int, arg(metavar="K")] = 1
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Read the source and write its tracks.

    Raises:
        BadInputError: an unknown source, files that are missing or damaged, an existing output.
    """
    from wildshape.cli.output import keep_apart
    from wildshape.cli.packing import write_tracks
    from wildshape.cli.terminal import answer, duration, progress, say

    began = time.monotonic()
    if settings.source not in SOURCES:
        raise BadInputError(
            f"'{settings.source}' is no source that can be converted; there are"
            f" {', '.join(SOURCES)}."
        )
    keep_apart(settings.root, settings.out)
    source, total = SOURCES[settings.source](settings)
    with progress(f"converting {settings.source}", total) as bar:
        written = write_tracks(
            source.tracks(),
            settings.out,
            settings.layout,
            command="convert",
            settings=_identity(settings),
            overwrite=settings.overwrite,
            at=bar.at,
        )
    for reason, count in source.rejected.items():
        say(f"left out: {count} x {reason}")
    seconds = time.monotonic() - began
    text = (
        f"converted {written.tracks} tracks, {written.scans} scans, {written.points} points in"
        f" {duration(seconds)}; see {settings.out}"
    )
    data = {"out": str(settings.out), **asdict(written), "left_out": dict(source.rejected)}
    answer(text, {**data, "seconds": round(seconds, 3)}, as_json=settings.json)


def _identity(settings: Settings) -> dict[str, Any]:
    names = ("source", "unit", "min_points", "min_scans", "every")
    chosen = {name: getattr(settings, name) for name in names}
    return {**chosen, "root": str(settings.root.resolve())}


@dataclass
class Opened:
    """Whatever `Reading` opens, as a source."""

    reading: "Reading"
    rejected: dict[str, int] = field(default_factory=Counter)

    def tracks(self) -> "Iterator[Track]":
        """The tracks that can be used."""
        yield from (track for _, track in self.reading.tracks())
        self.rejected = Counter(f"{what} ({reason})" for what, reason in self.reading.skipped)


def _kitti_raw(settings: Settings) -> "tuple[Source, int]":
    from wildshape.datasets.kitti_raw import KittiRaw

    source = KittiRaw(
        settings.root,
        every=settings.every,
        min_points=settings.min_points,
        min_scans=settings.min_scans,
    )
    return source, 0


def _opened(settings: Settings) -> "tuple[Source, int]":
    from wildshape.cli.reading import Reading

    source = Opened(Reading(settings.root, settings.unit))
    return source, len(source.reading.source)


SOURCES: dict[str, "Callable[[Settings], tuple[Source, int]]"] = {
    "kitti-raw": _kitti_raw,
    "folder": _opened,
    "packed": _opened,
}
