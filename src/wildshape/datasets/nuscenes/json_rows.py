# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rows of a JSON table that is too large to be held: a list of objects, a piece at a time."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

Row = dict[str, Any]
_PIECE = 1 << 20
_LARGEST_ROW = 1 << 20
_GAP = re.compile(r"[\s,]*")


def json_rows(path: Path) -> Iterator[Row]:
    """The objects of a list, in their order; memory does not grow with the file.

    Raises:
        BadInputError: the file is missing, cut off, or no list of objects.
    """
    with reading(path, "a JSON table"), path.open(encoding="utf-8") as file:
        text = file.read(_PIECE).lstrip()
        if not text.startswith("["):
            raise _damaged(path)
        decode, at = json.JSONDecoder().raw_decode, 1
        while True:
            at = _after_gap(text, at)
            if text.startswith("]", at):
                return
            try:
                row, at = decode(text, at)
            except json.JSONDecodeError:
                # Cut by the end of the piece, most likely: an object is whole only with its brace.
                text, at = _longer(file.read(_PIECE), text[at:], path), 0
                continue
            if not isinstance(row, dict):
                raise _damaged(path)
            yield row


def _after_gap(text: str, at: int) -> int:
    gap = _GAP.match(text, at)
    return gap.end() if gap else at


def _longer(piece: str, rest: str, path: Path) -> str:
    if not piece or len(rest) > _LARGEST_ROW:
        raise _damaged(path)
    return rest + piece


def _damaged(path: Path) -> BadInputError:
    return BadInputError(
        f"{path}: expected a list of JSON objects, whole to its closing bracket; unpack the table "
        "again."
    )
