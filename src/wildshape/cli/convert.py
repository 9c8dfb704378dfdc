# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape convert`: data sets as they lie on disk become tracks."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Layout, Overwrite, Unit
from wildshape.cli.sources import SOURCES, open_source

EXAMPLE = "wildshape convert kitti-raw 2011_09_26 cars.store"

Name = Annotated[str, Positional, arg(metavar="SOURCE", help=", ".join(SOURCES))]
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
    unit: Unit | None = None
    min_points: Annotated[int | None, arg(metavar="N")] = None
    min_scans: Annotated[int | None, arg(metavar="N")] = None
    every: Annotated[int | None, arg(metavar="K")] = None
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
    from wildshape.datasets.source import all_tracks

    began = time.monotonic()
    keep_apart(settings.root, settings.out)
    source = open_source(settings.source, settings.root, _options(settings))
    with progress(f"converting {settings.source}", 0) as bar:
        written = write_tracks(
            all_tracks(source),
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


def _options(settings: Settings) -> dict[str, Any]:
    """What the user gave, by the names of the readers' fields."""
    names = ("unit", "min_points", "min_scans", "every")
    given = {name: getattr(settings, name) for name in names}
    return {name: value for name, value in given.items() if value is not None}
