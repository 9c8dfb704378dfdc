# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing so that a final name never holds half a file, and no two processes mix their work.

A folder that is written is locked, by the system: the lock ends with the process, however that
ends, and leaves no file. Where there are no such locks (Windows, some network disks) nothing is
checked.
"""

import errno
import glob
import json
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import IO

from wildshape.errors import BadInputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_NAMED = 40  # characters of a file's name in that of its temporary one: names end at 255 bytes
_TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
_MASK = Lock()  # between setting and setting back, another thread would read what is set
_CLAIM = Lock()
_Folder = tuple[int, int]  # device and inode
_held: dict[_Folder, tuple[int, Path]] = {}  # its descriptor and place
_writers: dict[_Folder, object] = {}
_kept: set[Path] = set()


@contextmanager
def atomic_write(path: Path | str, *, flush: bool = False) -> Iterator[IO[bytes]]:
    """A binary file that appears under `path` only if the block ends without an error.

    It is written beside its final place and renamed; folders are made. After an error (Ctrl-C
    included) nothing is left and an older file under `path` is as it was.

    `flush`: to the disk, which takes milliseconds: for what took long to make, and is to be whole
    after a loss of power, too.

    Raises:
        OSError: the disk is full, the folder cannot be written or the name is too long; it names
            `path`.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with naming(path):
        with suppress(FileNotFoundError):
            path.lstat()  # a name that is too long fails here, and not after all is written
        descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=_prefix(path), suffix=".part")
    temporary = Path(name)
    try:
        with _at_work(descriptor):
            with os.fdopen(descriptor, "wb") as file:
                yield file
                if flush:
                    file.flush()
                    os.fsync(file.fileno())
            with naming(path):
                temporary.chmod(0o666 & ~_umask())
                temporary.replace(path)
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # a full disk names no file
            error.filename = str(path)
        raise


def remove_leftovers_of(path: Path) -> None:
    """Remove what processes left that were killed in `atomic_write` of this file.

    What one at work has begun stays: it holds a lock on it, or the system keeps open files.
    """
    for leftover in path.parent.glob(f"{glob.escape(_prefix(path))}*.part"):
        with suppress(OSError):  # at work, gone already, or not ours to remove
            if fcntl is None:
                leftover.unlink()
                continue
            with leftover.open("rb") as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                leftover.unlink()


def _prefix(path: Path) -> str:
    return f".{path.name[:_NAMED]}."


@contextmanager
def _at_work(descriptor: int) -> Iterator[None]:
    """Says that a file is being written, past its closing; the end of the process ends it."""
    if fcntl is None:
        yield
        return
    lock = os.dup(descriptor)
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(lock)


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Errors of the system name the file that was asked for, not the temporary one."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        del error.filename2  # None would be named, too
        raise


def write_text(path: Path | str, text: str, *, flush: bool = False) -> None:
    """Write UTF-8 text atomically; names of files that are no UTF-8 are spelt out."""
    with atomic_write(path, flush=flush) as file:
        file.write(text.encode("utf-8", "backslashreplace"))


def write_json(path: Path | str, data: object, *, flush: bool = False) -> None:
    """Write `data` as indented JSON, atomically.

    Raises:
        ValueError: a number is NaN or infinite (JSON has no such thing).
        TypeError: something in `data` is no JSON value.
    """
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n", flush=flush)


def _umask() -> int:
    """The process's file mode mask, which can only be read by setting it."""
    with _MASK:
        mask = os.umask(0o022)
        os.umask(mask)
    return mask


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
    _held[status.st_dev, status.st_ino] = folder, path.resolve()


def hold_folder(path: Path) -> Callable[[], None]:
    """As `lock_folder`, but for one writer alone: a second of this process is refused, too.

    Returns:
        Lets go; a claim of `lock_folder` that was there before stays. Once more does nothing.

    Raises:
        BadInputError: another writer is at work there.
        OSError: the folder cannot be made.
    """
    path.mkdir(parents=True, exist_ok=True)
    status, writer = path.stat(), object()
    folder = status.st_dev, status.st_ino
    with _CLAIM:
        if folder in _writers:
            raise BadInputError(
                f"{path}: another writer of this process is at work there; close it first, or"
                " choose another place to write."
            )
        before = _held.get(folder)
        lock_folder(path)
        mine = None if before is not None else _held.get(folder)
        _writers[folder] = writer

    def let_go() -> None:
        if _writers.get(folder) is not writer:
            return
        del _writers[folder]
        if mine is not None and _held.get(folder) == mine:
            os.close(_held.pop(folder)[0])

    return let_go


@contextmanager
def released_after(path: Path) -> Iterator[None]:
    """Claims of `lock_folder` in the block on a folder, and below it, end with the block.

    Those that were there before stay, and within such a block around this one all do.
    """
    place, before = path.resolve(), set(_held)
    if place in _kept:
        yield
        return
    _kept.add(place)
    try:
        yield
    finally:
        _kept.discard(place)
        for folder, (descriptor, at) in tuple(_held.items()):
            if folder not in before and at.is_relative_to(place):
                del _held[folder]
                os.close(descriptor)


def release_folders() -> None:
    """Give up all claims of this process."""
    _writers.clear()
    while _held:
        os.close(_held.popitem()[1][0])
