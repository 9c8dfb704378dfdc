# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damaged pieces of a part: passed over and counted, unless there is nothing else."""

from wildshape.errors import BadInputError

_NAMED = 3


class Damage:
    """What could not be read of a part.

    Attributes:
        rejected: where pieces are counted that were left out (see `Source`).
        read: how many pieces could be read.
    """

    def __init__(self, rejected: dict[str, int]) -> None:
        self.rejected, self.read = rejected, 0
        self._errors: list[BadInputError] = []

    def miss(self, what: str, error: BadInputError, count: int = 1) -> None:
        """Go on without a piece; the first of a part are named, the others are only counted.

        Args:
            what: a word for the piece: `scan`, `object`.
            error: what is wrong with it.
            count: how many pieces are lost by it.
        """
        self.note(error)
        named = error in self._errors
        reason = f"{what}: {error}" if named else f"{what}: damaged, as others"
        self.rejected[reason] = self.rejected.get(reason, 0) + count

    def note(self, error: BadInputError) -> None:
        """Remember what is wrong with a piece that is counted elsewhere."""
        self._errors = [*self._errors, error][:_NAMED]

    def settle(self) -> None:
        """At a part's end.

        Raises:
            BadInputError: the first damage that was met, if nothing at all could be read.
        """
        if self._errors and not self.read:
            raise self._errors[0]
