# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders (DESIGN, "Track folder") as a source: the way in for anybody's own scans."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.datasets.filtering import filtered
from wildshape.datasets.groups import groups, members
from wildshape.datasets.selection import Selection
from wildshape.io.inputs import open_tracks
from wildshape.io.points import Unit
from wildshape.io.tracks import NoUsableScanError
from wildshape.records import Track


@dataclass
class Folder:
    """A DATASET folder of TRACK folders, one of these, a folder of scan files, or one scan.

    Attributes:
        root: whatever `io.inputs.open_tracks` takes.
        selection: which objects and scans; 16 points are the least that any model takes.
        unit: of the coordinates on disk.
        rejected: see `Source`.
    """

    root: Path
    selection: Selection = Selection(min_points=16)
    unit: Unit = "m"
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """Groups of tracks in the order of their names.

        Raises:
            BadInputError: nothing at `root` that can be read as scans.
        """
        return groups(len(open_tracks(self.root, self.unit)))

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks in the order of their names; scans that cannot be used are left out and counted.

        Raises:
            BadInputError: a track's poses, shape or track.json is damaged.
        """
        source = open_tracks(self.root, self.unit)
        rejected = Counter(self.rejected)
        for index in members(part):
            try:
                track = filtered(source[index], self.selection, rejected)
            except NoUsableScanError:
                rejected["object: no scan that can be used"] += 1
                continue
            if track is not None:
                yield track
        for _, reason in source.skipped:
            rejected[f"scan: {reason.partition(': ')[2] or reason}"] += 1
        self.rejected = rejected
