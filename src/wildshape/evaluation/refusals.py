# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a method makes of a track of which it refuses some scans."""

from collections.abc import Callable, Sequence, Sized
from contextlib import suppress
from typing import TypeVar

from wildshape.errors import BadInputError
from wildshape.evaluation.cases import Case

Found = TypeVar("Found", bound=Sized)


def taken(case: Case, ask: Callable[[Case], Found]) -> tuple[Sequence[int], Found | None]:
    """The scans that a method takes, and what it answers of all these together.

    Which it refuses is found by asking of each alone; so the others keep what they tell each other.

    Args:
        case: the track.
        ask: what the method answers of scans, one a scan; `BadInputError` if it refuses one.

    Raises:
        BadInputError: the method answers of fewer or more scans than it took.
    """
    kept, answer = _taken(case, ask)
    if answer is not None and len(answer) != len(kept):
        raise BadInputError(
            f"{case.name}: the method answers {len(answer)} times for {len(kept)} scans; it must"
            " give one shape or pose a scan."
        )
    return kept, answer


def _taken(case: Case, ask: Callable[[Case], Found]) -> tuple[Sequence[int], Found | None]:
    every = range(len(case.scans))
    with suppress(BadInputError):
        return every, ask(case)
    kept = [i for i in every if _is_taken(ask, case.part([i]))]
    if 0 < len(kept) < len(every):
        with suppress(BadInputError):
            return kept, ask(case.part(kept))
    return [], None


def _is_taken(ask: Callable[[Case], object], alone: Case) -> bool:
    try:
        ask(alone)
    except BadInputError:
        return False
    return True
