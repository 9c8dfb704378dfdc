# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every failure of a file or of a library that reads it becomes one sentence.

What is read takes no more memory than ten times the file: promises of headers, JSON and lines of
text are checked before anything is allocated.
"""

import json
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from mmap import mmap
from pathlib import Path
from typing import IO, Any, AnyStr

from wildshape.errors import BadInputError, lacks_memory

MAX_POINTS = 100_000_000
"""More points in one scan of one object are taken for a damaged header."""

_MOST_TIMES, _MOST_BYTES = 10, 64 << 20
_FREE_UNPACKED, _MOST_UNPACKED = 32_000_000, 100
_FREE_BYTES, _RATIO, _CONTAINER_BYTES = 1 << 25, 6, 240
_LONGEST = 1 << 20  # characters: a PCD row may hold many numbers besides its point


@contextmanager
def reading(path: Path, expected: str) -> Iterator[None]:
    """Turn whatever goes wrong inside into a `BadInputError` naming `path` and `expected`.

    Warnings of the libraries are dropped: what matters in a damaged file is an error.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except BadInputError:
        raise
    except FileNotFoundError as error:
        raise BadInputError(f"{path}: no such file; check the path.") from error
    except OSError as error:
        _let_through(error, path)
        reason = error.strerror or first_line(error)
        raise BadInputError(f"{path}: cannot be read as {expected} ({reason}).") from error
    except BaseException as error:
        # Panics of libraries written in Rust (lazrs) are no `Exception`, unlike Ctrl-C they must
        # not end the program.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        _let_through(error, path)
        raise BadInputError(
            f"{path}: expected {expected}, found a damaged or foreign file "
            f"({type(error).__name__}: {first_line(error)}); write or copy it again."
        ) from error


def _let_through(error: BaseException, path: Path) -> None:
    """Raise MemoryError where memory is short; a damaged file asks for more than a reader needs.

    No reader needs more than ten times the file and 64 MB: where that much is to be had, it was
    the file that asked for too much.
    """
    if not lacks_memory(error):
        return
    try:
        mmap(-1, _MOST_TIMES * path.stat().st_size + _MOST_BYTES).close()
    except (OSError, ValueError, OverflowError):
        raise MemoryError(first_line(error)) from error


def first_line(error: BaseException, limit: int = 160) -> str:
    """The start of an error's message, on one line."""
    text = " ".join(str(error).split())
    return text if len(text) <= limit else text[: limit - 3] + "..."


def check_unpacked(path: Path, unpacked: int, packed: int) -> None:
    """Refuse a compressed file that unpacks to far more than any scan does.

    Args:
        path: named in the error.
        unpacked: bytes that it promises.
        packed: bytes that it holds.

    Raises:
        BadInputError: over a hundred times as many, and over 32 MB.
    """
    if unpacked > _FREE_UNPACKED + _MOST_UNPACKED * packed:
        raise BadInputError(
            f"{path}: {packed} bytes unpack to {unpacked}, which no scan does: damaged, or made to"
            " fill the memory; write it again."
        )


def check_promise(path: Path, what: str, promised: int, least: int, present: int) -> None:
    """Refuse a header that promises more than its file can hold, before anything is allocated.

    Args:
        path: named in the error.
        what: the name of the counted things, for example `points`.
        promised: how many of them the header promises.
        least: bytes that the promise needs at least.
        present: bytes that the file holds after its header.

    Raises:
        BadInputError: the promise is negative, absurd, or does not fit into the file.
    """
    if promised < 0:
        raise BadInputError(f"{path}: the header promises {promised} {what}; write the file again.")
    if least > present:
        raise BadInputError(
            f"{path}: the header promises {promised} {what} (at least {least} bytes), but only "
            f"{present} bytes follow it; the file is truncated or its header is wrong: copy or "
            "write it again."
        )
    if promised > MAX_POINTS:
        raise BadInputError(
            f"{path}: {promised} {what} is more than one scan of one object can hold "
            f"({MAX_POINTS}); cut the objects out of the scan first."
        )


def read_json(path: Path, expected: str, kind: type = object) -> Any:
    """What a JSON file holds.

    Args:
        path: of the file, in UTF-8.
        expected: what it should hold, for the error.
        kind: `dict` or `list`; anything by default.

    Raises:
        BadInputError: missing, damaged, of another kind, or hardly anything but brackets, which
            take far more memory than they take room in a file.
    """
    with reading(path, expected):
        found = parse_json(path.read_text("utf-8"), path, expected)
    if not isinstance(found, kind):
        raise BadInputError(
            f"{path}: expected {expected}, found {type(found).__name__}; write or copy it again."
        )
    return found


def parse_json(text: str, path: Path, expected: str) -> Any:
    """What a text in JSON holds; see `read_json`.

    Raises:
        BadInputError: hardly anything but brackets.
        ValueError: no JSON.
    """
    containers = text.count("[") + text.count("{")
    if _CONTAINER_BYTES * containers > _FREE_BYTES + _RATIO * len(text):
        raise BadInputError(
            f"{path}: expected {expected}, found {containers} brackets in {len(text)} letters; "
            "write or copy it again."
        )
    return json.loads(text)


def lines_of(file: IO[AnyStr], path: Path, longest: int = _LONGEST) -> Iterator[AnyStr]:
    """The lines that hold something, with their ends.

    Raises:
        BadInputError: a line is longer than `longest`.
    """
    while line := file.readline(longest + 1):
        if len(line) > longest:
            raise BadInputError(
                f"{path}: a line of more than {longest} characters is no point; write x y z a line."
            )
        if not line.isspace():
            yield line
