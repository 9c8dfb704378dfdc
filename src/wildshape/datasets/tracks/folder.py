# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders (docs/formats.md) as a source: the way in for anybody's own scans."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.datasets.tracks.damage import Damage
from wildshape.datasets.tracks.filtering import filtered, groups, members
from wildshape.datasets.tracks.selection import LARGEST_M, Selection
from wildshape.errors import BadInputError
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.scans.points import Coordinates, Unit
from wildshape.io.tracks import NoUsableScanError
from wildshape.records import Track


@dataclass
class Folder:
    """A DATASET folder of TRACK folders, one of these, a folder of scan files, or one scan.

    Attributes:
        root: whatever `io.inputs.open_tracks` takes.
        selection: which objects and scans; 16 points are the least that any model takes, and what
            is larger than any vehicle is left out: it may be a scan of a whole scene.
        unit: of the coordinates on disk.
        origin: the sensor's position in them.
        rejected: see `Source`.
    """

    root: Path
    selection: Selection = Selection(min_points=16, largest_m=LARGEST_M)
    unit: Unit = "m"
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        """Groups of tracks in the order of their names.

        Raises:
            BadInputError: nothing at `root` that can be read as scans.
        """
        return groups(len(self._source()))

    def tracks_of(self, part: str) -> Iterator[Track]:
        """Tracks in the order of their names; scans that cannot be used are left out and counted.

        Raises:
            BadInputError: a track's poses, shape or track.json is damaged.
        """
        source = self._source()
        rejected = Counter(self.rejected)
        damage = Damage(rejected)
        for index in members(part):
            try:
                track = filtered(source[index], self.selection, rejected)
            except NoUsableScanError as error:
                rejected["object: no scan that can be used"] += 1
                damage.note(error)
                continue
            except BadInputError as error:
                damage.miss("object", error)
                continue
            damage.read += 1
            if track is not None:
                yield track
        damage.settle()
        for _, reason in source.skipped:
            rejected[f"scan: {reason.partition(': ')[2] or reason}"] += 1
        self.rejected = rejected

    def _source(self) -> TrackSource:
        return open_tracks(self.root, Coordinates(self.unit, self.origin))
