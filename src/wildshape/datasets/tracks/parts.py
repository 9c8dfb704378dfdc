# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the parts of a data set are called: folders below its root, groups of tracks, frames."""

import re
from pathlib import Path

from wildshape.errors import BadInputError

_LEAST, _MOST_PARTS = 32, 1000


def named(folder: Path) -> Path:
    """A folder by a path that has its name and the folder above it: `.` has neither."""
    return folder if folder.name not in ("", "..") else folder.resolve()


def part_name(folder: Path, root: Path) -> str:
    """A folder as seen from the root, of which it may be the whole."""
    return named(folder).name if folder == root else folder.relative_to(root).as_posix()


def found_in(folder: Path) -> str:
    """What a folder holds, for an error: the first names."""
    if not folder.is_dir():
        return "no such folder"
    names = sorted(path.name for path in folder.iterdir())
    return f"found {', '.join(names[:8]) or 'an empty folder'}"


def numbered(folder: Path, suffix: str, none: str) -> dict[int, Path]:
    """The files of a folder by the number that is their name, in order; others are passed over.

    Raises:
        BadInputError: there is none; `none` says so, and what to do.
    """
    stems = {file.name.removesuffix(suffix): file for file in sorted(folder.glob(f"*{suffix}"))}
    files = {int(stem): file for stem, file in stems.items() if stem.isdecimal()}
    if not files:
        raise BadInputError(f"{folder}: {none}.")
    return dict(sorted(files.items()))


def groups(count: int) -> list[str]:
    """Names such as `000000-000031` of groups that cover tracks 0 to `count` - 1.

    At least 32 tracks a group, so that a part is worth its files, and at most a thousand groups.
    """
    size = max(_LEAST, -(-count // _MOST_PARTS))
    return [f"{i:06d}-{min(i + size, count) - 1:06d}" for i in range(0, count, size)]


def members(group: str) -> range:
    """The tracks of a group.

    Raises:
        BadInputError: no name that `groups` gives.
    """
    found = re.fullmatch(r"(\d+)-(\d+)", group)
    if not found:
        raise BadInputError(f"part '{group}': expected two numbers such as 000000-000031.")
    return range(int(found[1]), int(found[2]) + 1)
