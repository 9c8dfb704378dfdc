# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store as a source, for choosing from it, or for making folders of it."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.datasets.tracks.filtering import filtered, groups, members
from wildshape.datasets.tracks.selection import Selection
from wildshape.io.store.store import open_store
from wildshape.records import Track


@dataclass
class Packed:
    """A packed store.

    Attributes:
        root: of the store.
        selection: which objects and scans; 16 points are the least that any model takes.
        rejected: see `Source`.
    """

    root: Path
    selection: Selection = Selection(min_points=16)
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """Groups of tracks in the order of the store.

        Raises:
            BadInputError: no store, or a damaged one.
        """
        return groups(len(open_store(self.root)))

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks in the order of the store, one held at a time."""
        store, rejected = open_store(self.root), Counter(self.rejected)
        for index in members(part):
            track = filtered(store.track(index), self.selection, rejected)
            if track is not None:
                yield track
        self.rejected = rejected
