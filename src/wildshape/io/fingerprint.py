# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tells cheaply that files of tracks were added, removed or replaced."""

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from wildshape.io.scans.points import is_scan_file

_BESIDE = ("rays/*.npz", "poses.txt", "shape.ply", "track.json")


def fingerprint_of(path: Path) -> str:
    """Of the names and sizes of the files that `open_tracks` reads at a path.

    No file is opened. Times do not count: a copy has the fingerprint of its original.

    Args:
        path: a scan file, a folder of scans, a TRACK or a DATASET; one that is gone has no files.
    """
    files = [path] if path.is_file() else _files_in(path)
    lines = sorted(
        os.fsencode(file.relative_to(path)) + b"\0%d\n" % file.stat().st_size for file in files
    )
    return hashlib.sha256(b"".join(lines)).hexdigest()[:16]


def _files_in(folder: Path) -> Iterator[Path]:
    """Of a TRACK, of each TRACK of a DATASET, or else the scans of a plain folder."""
    scans = [folder / "scans"] if (folder / "scans").is_dir() else folder.glob("[!.]*/scans")
    tracks = [place.parent for place in scans if place.is_dir()]
    for track in tracks:
        yield from filter(is_scan_file, track.glob("scans/*"))
        yield from (file for beside in _BESIDE for file in track.glob(beside) if file.is_file())
    if not tracks:
        yield from filter(is_scan_file, folder.glob("*"))
