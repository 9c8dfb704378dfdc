# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every reader of a published data set offers; the readers do not import this file."""

from collections.abc import Iterator
from typing import Protocol, runtime_checkable

from wildshape.records import Track


@runtime_checkable
class Source(Protocol):
    """A data set as it lies on disk, read part by part into tracks.

    Readers are plain dataclasses that can be pickled: a worker gets its own copy.

    Attributes:
        rejected: how many drives, objects and scans were left out so far, by reason.
    """

    rejected: dict[str, int]

    def parts(self) -> list[str]:
        """Names of the independent parts (drives, sequences, logs), in a fixed order; cheap.

        Raises:
            BadInputError: not such a data set; the message says what was expected and found.
        """
        ...

    def tracks_of(self, part: str) -> Iterator[Track]:
        """The tracks of one part, in a fixed order, one held at a time.

        Raises:
            BadInputError: a file is missing or corrupt; the message names it.
        """
        ...


def all_tracks(source: Source) -> Iterator[Track]:
    """The tracks of all parts of a data set, one held at a time.

    Raises:
        BadInputError: see `Source`.
    """
    for part in source.parts():
        yield from source.tracks_of(part)
