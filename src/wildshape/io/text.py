# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points as text: .xyz, .txt, .csv; white space, commas or semicolons, perhaps a header line."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError

_SEPARATORS = re.compile(r"[,;\s]+")
_TRANSLATION = str.maketrans(",;\t", "   ")


def read_text(path: Path) -> Float[np.ndarray, "n 3"]:
    """The columns named x y z in a header line, or else the first three, in the file's unit.

    Lines that start with # or // are comments; a first line without three numbers is a header.

    Raises:
        BadInputError: a line without numbers where they are expected.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInputError(
            f"{path}: expected text with x y z a line, found binary data."
        ) from error
    lines = [line for line in text.splitlines() if line.strip() and not _is_comment(line)]
    if not lines:
        return np.empty((0, 3))
    columns = (0, 1, 2)
    if not _has_numbers(lines[0]):
        columns = _named_columns(lines.pop(0))
    if not lines:
        return np.empty((0, 3))
    rows = [line.translate(_TRANSLATION) for line in lines]
    return np.loadtxt(rows, usecols=columns, ndmin=2, comments="#")


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(("#", "//"))


def _words(line: str) -> list[str]:
    return [word.strip("\"'") for word in _SEPARATORS.split(line.strip()) if word]


def _has_numbers(line: str) -> bool:
    try:
        return len([float(word) for word in _words(line)[:3]]) == 3
    except ValueError:
        return False


def _named_columns(line: str) -> tuple[int, int, int]:
    names = [word.lower() for word in _words(line)]
    if {"x", "y", "z"} <= set(names):
        return names.index("x"), names.index("y"), names.index("z")
    return 0, 1, 2
