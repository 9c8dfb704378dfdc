# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An earlier output, set aside within its folder until the one that replaces it is finished.

Its marker goes first and comes last, so that nobody takes the output for whole, and so that what
was stopped on the way is repeated.
"""

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

MARKER = "wildshape.json"
MOVED = "wildshape-removed.json"  # the marker of an output while its files are moved or removed
EARLIER = ".earlier"
MARKERS = (MARKER, MOVED, f"{EARLIER}/{MARKER}")


def set_aside(path: Path, patterns: Sequence[str]) -> None:
    """Clear a folder of an output: it is kept, unless it was itself to replace one that is kept.

    `patterns`: of the output's files; others stay, folders that are empty then do not.
    """
    if (path / MARKER).is_file():
        (path / MARKER).replace(path / MOVED)
    kept = (path / EARLIER / MARKER).is_file()
    for file in list(_files(path, patterns)):
        if kept:
            file.unlink()
        else:
            _move(file, path / EARLIER / file.relative_to(path))
    _remove_empty_folders(path)
    if not kept:
        _move(path / MOVED, path / EARLIER / MARKER)


def put_back(path: Path, patterns: Sequence[str]) -> bool:
    """What was set aside, in place of the new output; `patterns` are of its files.

    Returns:
        False where nothing was set aside.
    """
    earlier = path / EARLIER
    if not (earlier / MARKER).is_file():
        return False
    set_aside(path, patterns)
    (earlier / MARKER).replace(path / MOVED)
    for file in [file for file in earlier.rglob("*") if file.is_file()]:
        _move(file, path / file.relative_to(earlier))
    _remove_empty_folders(path)
    (path / MOVED).replace(path / MARKER)
    return True


def forget(path: Path) -> None:
    """Remove what was set aside."""
    shutil.rmtree(path / EARLIER, ignore_errors=True)


def _files(path: Path, patterns: Sequence[str]) -> Iterator[Path]:
    found = {file: None for pattern in patterns for file in path.glob(pattern)}
    for file in found:
        ours = file.relative_to(path).parts[0] != EARLIER and file != path / MOVED
        if ours and file.is_file():
            yield file


def _move(file: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(file, target)


def _remove_empty_folders(path: Path) -> None:
    for folder in sorted((f for f in path.rglob("*") if f.is_dir()), reverse=True):
        if not any(folder.iterdir()):
            folder.rmdir()
