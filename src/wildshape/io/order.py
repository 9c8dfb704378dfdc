# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether names that are sorted as text are in the order of their numbers."""

import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from wildshape.errors import BadInputError

# No dates; seconds are decimals, and nuScenes' files end in `.pcd.bin`.
_COUNTED = re.compile(r"(?P<before>|.*[^0-9.-]|.*[^0-9]-)(?P<number>[0-9]+(?:\.[0-9]+)?)(?:\.pcd)?")


def out_of_order(stems: Sequence[str]) -> int | None:
    """Where names that only count go back: `scan_10` is before `scan_9`, `10.0` before `9.5`.

    Args:
        stems: of files, sorted as text.

    Returns:
        The place of the first name whose successor has a smaller number; None where there is none,
        or where the names differ by more than a number at their end.
    """
    numbers = numbers_of(stems)
    return next((i for i, (one, other) in enumerate(pairwise(numbers)) if one > other), None)


def numbers_of(stems: Sequence[str]) -> list[float]:
    """The numbers at the end of names that differ by them alone; none of other names."""
    counts = [_COUNTED.fullmatch(stem) for stem in stems]
    if None in counts or len({count["before"] for count in counts if count}) > 1:
        return []
    return [float(count["number"]) for count in counts if count]


def check_counted(files: Sequence[Path]) -> None:
    """Refuse files, sorted by name, whose numbers go back for want of leading zeros.

    Raises:
        BadInputError: two do.
    """
    row = out_of_order([file.stem for file in files])
    if row is not None:
        raise BadInputError(
            f"{files[row].parent}: {files[row].name} is sorted before {files[row + 1].name}, for"
            " names are sorted as text; write their numbers with leading zeros."
        )
