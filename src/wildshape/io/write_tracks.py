# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks written as they come, as a packed store or as track folders."""

import json
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from wildshape.arguments import as_path
from wildshape.errors import BadInputError
from wildshape.io.atomic import lock_folder
from wildshape.io.output import begin, command_line, file_name, provenance
from wildshape.io.progress import SILENT, Progress
from wildshape.io.store.layout import INDEX_JSON
from wildshape.io.store.origin import is_begun_by
from wildshape.io.store.store import StoreWriter
from wildshape.io.tracks import is_placed, place_track, write_track
from wildshape.records import Track

Layout = Literal["packed", "folders"]
"""One packed store, or track folders with a file a scan."""

FILES = ("*/scans/*.ply", "*/rays/*.npz", "*/poses.txt", "*/shape.ply", "*/track.json")
_UNFINISHED = ".unfinished"


@dataclass
class Written:
    """How much was written."""

    tracks: int = 0
    scans: int = 0
    points: int = 0

    def count(self, track: Track) -> None:
        """Add a track."""
        self.tracks += 1
        self.scans += len(track.scans)
        self.points += sum(len(scan) for scan in track.scans)


def write_tracks(
    tracks: Iterable[Track],
    out: Path | str,
    layout: Layout,
    *,
    command: str,
    settings: dict[str, Any],
    overwrite: bool = False,
    progress: Progress = SILENT,
    bar: tuple[str, int] = ("writing tracks", 0),
) -> Written:
    """Write tracks as they come.

    Args:
        tracks: in order; made again from the first where an earlier run was interrupted.
        out: the store or the DATASET folder.
        layout: which of the two.
        command: that writes.
        settings: JSON values; all that decides the tracks.
        overwrite: replace an earlier output.
        progress: is told what goes on.
        bar: what is done, and how many tracks there are to come, 0 if nobody knows.

    Raises:
        BadInputError: something is at `out` already, or no track came.
    """
    if layout not in get_args(Layout):
        raise BadInputError(f"layout {layout!r}: there are {' and '.join(get_args(Layout))}.")
    if isinstance(tracks, Track):
        raise BadInputError("tracks: expected several, found one; put it in a list.")
    write, out = _packed if layout == "packed" else _folders, as_path(out, "out")
    settings = json.loads(json.dumps(settings, default=str))
    written = Written()
    output = _Output(out, command, settings, overwrite, progress)
    with progress.bar(*bar) as shown:
        for track in write(tracks, output):
            written.count(track)
            shown.at(written.tracks)
    if not written.tracks:
        raise BadInputError(f"{out}: no track came out of the source; check it and its options.")
    return written


class _Output(NamedTuple):
    """Where tracks go; the fields are those of `write_tracks`."""

    out: Path
    command: str
    settings: dict[str, Any]
    overwrite: bool
    progress: Progress


def _packed(tracks: Iterable[Track], wanted: _Output) -> Iterator[Track]:
    """Into a packed store, which cannot be gone on with: a half-written one is begun again."""
    out = wanted.out
    made = {"made_by": wanted.command, "settings": wanted.settings}
    origin = provenance(command_line()) | made
    first, tracks = _first(tracks)
    if not first:
        return  # nothing half-written stays behind
    if not out.is_file():
        lock_folder(out)
    again = is_begun_by(out, origin) and not (out / INDEX_JSON).exists()
    if again:
        wanted.progress.say(f"beginning the half-written store {out} again")
    with StoreWriter(out, origin, overwrite=wanted.overwrite or again) as writer:
        for track in chain(first, tracks):
            writer.add(track)
            yield track


def _first(tracks: Iterable[Track]) -> tuple[list[Track], Iterator[Track]]:
    """The first track, if there is one, and an iterator over the others."""
    rest = iter(tracks)
    return list(islice(rest, 1)), rest


def _folders(tracks: Iterable[Track], wanted: _Output) -> Iterator[Track]:
    """Into track folders; each appears under its name whole, but for what `place_track` says."""
    out, command, settings, overwrite, progress = wanted
    output = begin(out, command, settings, FILES, overwrite=overwrite, progress=progress)
    unfinished = out / _UNFINISHED
    shutil.rmtree(unfinished, ignore_errors=True)
    with output.abandoned_if_refused():
        first, tracks = _first(tracks)
        if not first:
            return output.abandon()
        for track in chain(first, tracks):
            folder = out / file_name(track.name)
            if not is_placed(folder):
                write_track(unfinished / track.name, track)
                place_track(unfinished / track.name, folder)
            yield track
    shutil.rmtree(unfinished, ignore_errors=True)
    output.finish()
