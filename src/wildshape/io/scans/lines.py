# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Lines of text read one at a time, each of a bounded length: no file can make one costly."""

from collections.abc import Iterator
from pathlib import Path
from typing import IO, AnyStr

from wildshape.errors import BadInputError

_LONGEST = 1 << 20  # characters: a PCD row may hold many numbers besides its point


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
