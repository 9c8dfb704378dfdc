# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What no figure is made of: named, with its reason, so that nothing is dropped in silence."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass


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
