# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store as a source: nothing is left out, it was chosen when it was written."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.io.store import open_store
from wildshape.records import Track


@dataclass
class Packed:
    """A packed store.

    Attributes:
        root: of the store.
        rejected: see `Source`; always empty.
    """

    root: Path
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def tracks(self) -> Iterator[Track]:
        """Tracks in the order of the store, one held at a time.

        Raises:
            BadInputError: no store, or a damaged one.
        """
        yield from open_store(self.root)
