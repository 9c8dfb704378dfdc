# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""JSON files that are read whole: one that would not fit into ten times its size is refused."""

import json
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.guard import reading

_FREE_BYTES, _RATIO, _CONTAINER_BYTES = 1 << 25, 6, 240


def read_json(path: Path, expected: str) -> Any:
    """What a JSON file holds.

    Args:
        path: of the file, in UTF-8.
        expected: what it should hold, for the error.

    Raises:
        BadInputError: missing, damaged, or hardly anything but brackets, which take far more
            memory than they take room in a file.
    """
    with reading(path, expected):
        text = path.read_text("utf-8")
        containers = text.count("[") + text.count("{")
        if _CONTAINER_BYTES * containers > _FREE_BYTES + _RATIO * len(text):
            raise BadInputError(
                f"{path}: expected {expected}, found {containers} brackets in {len(text)} letters; "
                "write or copy it again."
            )
        return json.loads(text)
