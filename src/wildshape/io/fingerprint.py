# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tells cheaply that files of tracks were added, removed or replaced."""

import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from wildshape.io.scans.points import is_scan_file
from wildshape.io.store.store import is_store, open_store

_LOOKED_AT_BYTES = 4096  # of each file, in its middle: headers are alike
_BESIDE = ("rays/*.npz", "poses.txt", "shape.ply", "track.json")


def fingerprint_of(path: Path) -> str:
    """Of the names and sizes of the files that `open_tracks` reads at a path, and of their middles.

    Times do not count: a copy has the fingerprint of its original.

    Args:
        path: whatever `open_tracks` takes; a packed store has its own fingerprint, and what is
            gone has no files.
    """
    if is_store(path):
        return open_store(path).fingerprint
    return fingerprint_of_files([path] if path.is_file() else _files_in(path), path)


def fingerprint_of_files(files: Iterable[Path], folder: Path) -> str:
    """The same of files below a folder."""
    lines = sorted(os.fsencode(file.relative_to(folder)) + _glance(file) for file in files)
    return hashlib.sha256(b"".join(lines)).hexdigest()[:16]


def _glance(file: Path) -> bytes:
    if not file.exists():
        return b"\0lost\n"  # a link to nowhere: the scan is skipped, and told
    size = file.stat().st_size
    with file.open("rb", buffering=0) as opened:
        opened.seek(max(0, (size - _LOOKED_AT_BYTES) // 2))
        return b"\0%d\0" % size + opened.read(_LOOKED_AT_BYTES) + b"\n"


def _files_in(folder: Path) -> Iterator[Path]:
    """Of a TRACK, of each TRACK of a DATASET, or else the scans of a plain folder."""
    own = (folder / "scans").is_dir()
    below = ("scans",) if own else ("[!.]*/scans", "[!.]*/tracks/[!.]*/scans")
    scans = (place for pattern in below for place in folder.glob(pattern))
    tracks = [place.parent for place in scans if place.is_dir()]
    for track in tracks:
        yield from filter(is_scan_file, track.glob("scans/*"))
        yield from (file for beside in _BESIDE for file in track.glob(beside) if file.is_file())
    if not tracks:
        yield from filter(is_scan_file, folder.glob("*"))
