# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pipes: `-` is a scan on stdin, and `--out -` one shape on stdout."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from wildshape.cli.options import is_pipe
from wildshape.errors import BadInputError
from wildshape.io.atomic import naming


@contextmanager
def as_file(path: Path, kind: str) -> Iterator[Path]:
    """The path itself; for `-` a file, as long as the block lasts, that holds all of stdin.

    Args:
        path: what a user named.
        kind: of `Format`.

    Raises:
        BadInputError: stdin is a terminal, empty or of no known kind; whatever is said of the file
            inside the block says `stdin`. Or a kind is named for what is no pipe.
    """
    if not is_pipe(path):
        if kind != "auto":
            raise BadInputError(f"{path}: a file's suffix says its kind; --format is for stdin.")
        yield path
        return
    data = _all_of_stdin()
    with TemporaryDirectory(prefix="wildshape.") as folder:
        file = Path(folder) / f"stdin{_suffix(data, kind)}"
        with naming(file):
            file.write_bytes(data)
        try:
            yield file
        except BadInputError as error:
            raise BadInputError(str(error).replace(str(file), "stdin")) from error


def write_stdout(data: bytes) -> None:
    """Bytes to stdout, and nothing else.

    Raises:
        BadInputError: stdout is a terminal.
    """
    refuse_terminal()
    sys.stdout.buffer.write(data)
    sys.stdout.flush()


def refuse_terminal() -> None:
    """Refuse, before any work is done, to write a file to a terminal.

    Raises:
        BadInputError: stdout is one.
    """
    if sys.stdout.isatty():
        raise BadInputError("stdout is a terminal; add `> shape.ply`, or pass --json.")


def _all_of_stdin() -> bytes:
    if sys.stdin is None or sys.stdin.isatty():
        raise BadInputError("stdin is a terminal; pipe a scan into it, for example `< scan.ply`.")
    data = sys.stdin.buffer.read()
    if not data:
        raise BadInputError("stdin: is empty; pipe a scan into it, for example `< scan.ply`.")
    return data


def _suffix(data: bytes, kind: str) -> str:
    from wildshape.io.scans.recognise import suffix_of

    found = suffix_of(data) if kind == "auto" else f".{kind}"
    if not found:
        raise BadInputError(
            "stdin: is of no kind that can be told from how it begins; name it with --format, for"
            " example --format bin."
        )
    return found
