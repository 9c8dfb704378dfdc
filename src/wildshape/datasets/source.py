# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every reader of a published data set offers; the readers do not import this file."""

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

from wildshape.records import Track


@runtime_checkable
class Source(Protocol):
    """A data set as it lies on disk, read into tracks one at a time.

    Attributes:
        rejected: how many drives, objects and scans were left out so far, by reason; complete
            once `tracks()` is exhausted, and started afresh by the next call.
    """

    rejected: dict[str, int]

    def tracks(self) -> Iterator[Track]:
        """The tracks, in a fixed order.

        Raises:
            BadInputError: a file is missing or corrupt; the message names it.
        """
        ...
