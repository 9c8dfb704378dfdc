# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What no figure is made of: named, with its reason, so that nothing is dropped in silence."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Skipped:
    """One scan that did not count, or one track completed as a whole (then its middle scan).

    Attributes:
        track: name.
        scan: name.
        reason: in a few words, the same for all of a kind.
    """

    track: str
    scan: str
    reason: str


def by_reason(skipped: Iterable[Skipped]) -> dict[str, int]:
    """How many, by reason."""
    return dict(Counter(one.reason for one in skipped))


def with_rows(skipped: Iterable[tuple[str, Skipped]]) -> list[dict[str, object]]:
    """Every scan left out, once a reason, with the rows of the table that it is missing from.

    Args:
        skipped: name of the row, and what is missing from it.
    """
    rows: dict[Skipped, dict[str, None]] = {}
    for name, one in skipped:
        rows.setdefault(one, {})[name] = None
    return [{**asdict(one), "methods": list(names)} for one, names in rows.items()]
