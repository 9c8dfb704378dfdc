# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One part of a data set, converted: a function of the part alone, wherever it runs."""

import json
import shutil
from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

from wildshape.datasets.tracks.source import Source
from wildshape.datasets.tracks.truth import TruthBuilder, misplaced
from wildshape.errors import BadInputError, SharedInputError
from wildshape.io.atomic import write_json
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.io.tracks import write_track
from wildshape.io.write_tracks import Layout
from wildshape.records import Track

STORE, TRACKS = "store", "tracks"
_RESULT = "part.json"
DAMAGED = "part: damaged, left out whole"
_POSES_CURE = "check unit, frame and direction of its poses, and the scale of its scans"


@dataclass
class PartResult:
    """What became of a part.

    Attributes:
        tracks: how many were written; `scans` and `points` likewise.
        left_out: how many objects and scans were not, by reason.
        names: of the tracks that were written as folders, in order.
        damage: why the part could not be read, in a sentence; it is left out whole then.
        doubts: a sentence each on what was read and may not be meant.
        categories: of the tracks written, how many each.
    """

    part: str
    tracks: int = 0
    scans: int = 0
    points: int = 0
    left_out: dict[str, int] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    damage: str = ""
    doubts: list[str] = field(default_factory=list)
    categories: dict[str, int] = field(default_factory=dict)

    def count(self, track: Track) -> None:
        """Add a track."""
        self.tracks += 1
        self.categories[track.category] = self.categories.get(track.category, 0) + 1
        self.scans += len(track.scans)
        self.points += sum(len(scan) for scan in track.scans)


class Part(NamedTuple):
    """One of a data set's parts."""

    number: int
    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Conversion:
    """`convert_part` for each part of a data set; handed to workers.

    Attributes:
        folder: of the finished parts.
        layout: see `convert_part`; `truth` likewise.
    """

    source: Source
    folder: Path
    layout: Layout = "packed"
    truth: TruthBuilder | None = None

    def place(self, part: Part) -> Path:
        """Where a part goes."""
        return self.folder / f"{part.number:06d}"

    def finished(self, part: Part) -> PartResult | None:
        """See `finished_part`."""
        return finished_part(self.place(part), part.name)

    def __call__(self, part: Part) -> tuple[Part, PartResult]:
        """Convert a part; one that is damaged is left out, for the others are not.

        Raises:
            SharedInputError: what is damaged concerns all parts.
        """
        place, how = self.place(part), {"layout": self.layout, "truth": self.truth}
        try:
            return part, convert_part(self.source, part.name, place, **how)
        except SharedInputError:
            raise
        except BadInputError as error:
            return part, PartResult(part.name, left_out={DAMAGED: 1}, damage=str(error))


def convert_part(
    source: Source,
    part: str,
    folder: Path,
    *,
    layout: Layout = "packed",
    truth: TruthBuilder | None = None,
) -> PartResult:
    """Write the tracks of one part; `folder` appears when it is whole, or not at all.

    It holds `part.json` and, if there is any track, a packed store `store/` or, for the layout
    `folders`, `tracks/000000/` and so on. Where another process has made it meanwhile, that one's
    stays: they are equal.

    Raises:
        BadInputError: a file of the part is missing or corrupt.
        OSError: the disk is full.
    """
    source = copy(source)
    source.rejected = Counter()
    result = PartResult(part)
    unfinished = folder.with_name(f".{folder.name}.{uuid4().hex[:8]}")
    unfinished.mkdir(parents=True)
    try:
        tracks = _counted(source, result, truth)
        (_write_store if layout == "packed" else _write_folders)(tracks, unfinished, result)
        result.left_out = dict(sorted((result.left_out | source.rejected).items()))
        result.doubts += getattr(source, "doubts", ())
        write_json(unfinished / _RESULT, asdict(result))
        _put(unfinished, folder, result.part)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return result


def finished_part(folder: Path, part: str) -> PartResult | None:
    """What an earlier run left of a part in `folder`, if it is there and whole."""
    try:
        result = PartResult(**json.loads((folder / _RESULT).read_text("utf-8")))
        stored = len(open_store(folder / STORE)) if (folder / STORE).exists() else 0
    except (OSError, ValueError, TypeError):  # BadInputError is a ValueError
        return None
    whole = result.tracks in (stored, len(result.names))
    return result if whole and result.part == part else None


def _counted(source: Source, result: PartResult, truth: TruthBuilder | None) -> Iterator[Track]:
    looked = False
    for track in source.tracks_of(result.part):
        # A labelled box need not be asked: its scans were cut out by its pose.
        if not looked and track.T_sensor_object is not None and track.label_size_m is None:
            looked = True
            if odd := misplaced(track):
                result.doubts.append(f"{track.name}: {odd}; {_POSES_CURE}")
        shaped = track if truth is None else truth.with_shape(track)
        if shaped is None:
            posed = track.T_sensor_object is not None
            lacking = "no point is left of it" if posed else "the object has no poses"
            reason = f"truth: no shape, for {lacking}"
            result.left_out[reason] = result.left_out.get(reason, 0) + 1
        chosen = shaped or track
        result.count(chosen)
        yield chosen


def _write_store(tracks: Iterator[Track], folder: Path, result: PartResult) -> None:
    first = next(tracks, None)
    if first is None:
        return
    with StoreWriter(folder / STORE, {"part": result.part}) as writer:
        writer.add(first)
        for track in tracks:
            writer.add(track)


def _write_folders(tracks: Iterator[Track], folder: Path, result: PartResult) -> None:
    for number, track in enumerate(tracks):
        write_track(folder / TRACKS / f"{number:06d}", track)
        result.names.append(track.name)


def _put(unfinished: Path, folder: Path, part: str) -> None:
    """Give a part its name, unless it is there already; what is damaged makes room."""
    if folder.exists() and finished_part(folder, part) is None:
        shutil.rmtree(folder)
    try:
        unfinished.rename(folder)
    except OSError:
        if not folder.exists():
            raise
