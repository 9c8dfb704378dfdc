# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One process at a time writes a folder: a second is refused instead of mixing its work in.

The folder itself is locked, by the system: the lock ends with the process, however that ends, and
leaves no file. Where there are no such locks (Windows, some network disks) nothing is checked.
"""

import errno
import os
from pathlib import Path

from wildshape.errors import BadInputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
_held: dict[tuple[int, int], int] = {}


def lock_folder(path: Path) -> None:
    """Make a folder, and claim it until `release_folders` or the end of this process.

    Raises:
        BadInputError: another process writes there.
        OSError: the folder cannot be made.
    """
    path.mkdir(parents=True, exist_ok=True)
    if fcntl is None:
        return
    folder = os.open(path, os.O_RDONLY)
    status = os.fstat(folder)
    if (status.st_dev, status.st_ino) in _held:
        os.close(folder)
        return
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(folder)
        if error.errno in _TAKEN:
            raise BadInputError(
                f"{path}: another process is writing there; wait until it is done, or choose"
                " another place to write."
            ) from error
        return
    _held[status.st_dev, status.st_ino] = folder


def release_folders() -> None:
    """Give up all claims of this process."""
    while _held:
        os.close(_held.popitem()[1])
