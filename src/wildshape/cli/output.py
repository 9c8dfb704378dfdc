# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where commands write: folders begun and gone on with (`io/output.py`), and single files."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wildshape.cli.terminal import say
from wildshape.errors import BadInputError
from wildshape.io import output
from wildshape.io.output import (
    MARKER,
    Output,
    is_begun,
    keep_apart,
    remove_leftovers,
    unfinished,
)

__all__ = [
    "MARKER",
    "Output",
    "begin",
    "command_line",
    "is_begun",
    "keep_apart",
    "refuse_file",
    "remove_leftovers",
    "unfinished",
]


def begin(
    path: Path,
    command: str,
    settings: dict[str, Any],
    files: Sequence[str],
    *,
    overwrite: bool = False,
) -> Output:
    """`io.output.begin`, and say so where an interrupted run is gone on with."""
    begun = output.begin(path, command, settings, files, command_line(), overwrite=overwrite)
    if begun.resumed:
        say(f"going on with the unfinished output in {path}")
    return begun


def command_line() -> str:
    """As a user would type it again."""
    return shlex.join(["wildshape", *sys.argv[1:]])


def refuse_file(path: Path, *, overwrite: bool) -> None:
    """Refuse to write over a file.

    Raises:
        BadInputError: it exists, and `overwrite` was not given; or it is a folder.
    """
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder; --out names a file to write.")
    if path.exists() and not overwrite:
        raise BadInputError(f"{path}: exists; pass --overwrite to replace it.")
