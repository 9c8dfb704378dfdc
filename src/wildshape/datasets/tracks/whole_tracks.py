# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks that are there as a whole, as a data set: track folders, and the packed store.

The way in for anybody's own scans, for choosing from a store, and for making folders of it.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from wildshape.datasets.tracks.gathering import Damage
from wildshape.datasets.tracks.parts import groups, members
from wildshape.datasets.tracks.selection import LARGEST_M, Selection
from wildshape.errors import BadInputError
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.scans.points import Coordinates, Unit
from wildshape.io.store.store import open_store
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
        doubts: see `TrackSource`, of the part that was read last.
    """

    root: Path
    selection: Selection = Selection(min_points=16, largest_m=LARGEST_M)
    unit: Unit = "m"
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rejected: dict[str, int] = field(default_factory=Counter, init=False)
    doubts: tuple[str, ...] = field(default=(), init=False)

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
        damage = Damage(self.rejected)
        for index in members(part):
            try:
                track = filtered(source[index], self.selection, self.rejected)
            except NoUsableScanError as error:
                self.rejected["object: no scan that can be used"] += 1
                damage.note(error)
                continue
            except BadInputError as error:
                damage.miss("object", error)
                continue
            damage.read += 1
            if track is not None:
                yield track
        damage.settle()
        self.doubts = source.doubts
        named: dict[str, str] = {}  # of each reason, the first file
        for _, reason in source.skipped:
            why = reason.partition(": ")[2] or reason
            self.rejected[named.setdefault(why, f"scan: {reason}")] += 1

    def _source(self) -> TrackSource:
        return open_tracks(self.root, Coordinates(self.unit, self.origin))


@dataclass
class Packed:
    """A packed store.

    Attributes:
        root: of the store.
        selection: which objects and scans; 16 points are the least that any model takes.
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
        store = open_store(self.root)
        for index in members(part):
            track = filtered(store.track(index), self.selection, self.rejected)
            if track is not None:
                yield track


def filtered(track: Track, selection: Selection, rejected: dict[str, int]) -> Track | None:
    """What a selection leaves of a track, if it leaves anything.

    Args:
        track: as it was read; whether its object moved is not known, for the sensor may have.
        selection: see there; empty categories are all of them.
        rejected: what is left out is counted here, by reason.
    """
    if selection.categories and track.category not in selection.categories:
        rejected[f"object: category {track.category or 'unknown'}"] += 1
        return None
    kept = []
    for i in range(0, len(track.scans), selection.every):
        objection = selection.objection_to_scan(track.scans[i])
        if objection:
            rejected[objection] += 1
        else:
            kept.append(i)
    chosen = track if len(kept) == len(track.scans) else track.part(kept)
    objection = selection.objection_to_track(chosen, None)
    if objection:
        rejected[objection] += 1
    return None if objection else chosen
