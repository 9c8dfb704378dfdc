# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Crops of objects, as they come frame by frame, gathered into tracks; damaged pieces counted."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np

from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Points, Sensor, SightLines, Track

Scan = TypeVar("Scan")

_NAMED = 3


class Damage:
    """What could not be read of a part: passed over and counted, unless there is nothing else.

    Attributes:
        rejected: where pieces are counted that were left out (see `Source`).
        read: how many pieces could be read.
    """

    def __init__(self, rejected: dict[str, int]) -> None:
        self.rejected, self.read = rejected, 0
        self._errors: list[BadInputError] = []

    def miss(self, what: str, error: BadInputError, count: int = 1) -> None:
        """Go on without a piece; the first of a part are named, the others are only counted.

        `what` is a word for the piece (`scan`, `object`), `count` how many are lost by it.
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


@dataclass
class _Object:
    """What was seen of one object so far."""

    category: str
    source: str
    offered: int = 0
    last_frame: int = 0
    scans: list[Points] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    poses: list[SE3] = field(default_factory=list)
    places: list[np.ndarray] = field(default_factory=list)
    rays: list[SightLines | None] = field(default_factory=list)
    label_size_m: tuple[float, float, float] | None = None


class Gathering:
    """Collects the scans of many objects at once; holds only those that may still be seen.

    Attributes:
        selection: which objects and scans.
        sensor: that took the scans.
        rejected: how much was left out, by reason (see `Source`).
        rays: whether the rays that passed the objects by are kept.
        damage: frames that could not be read.
    """

    def __init__(
        self,
        selection: Selection,
        sensor: Sensor,
        rejected: dict[str, int],
        *,
        rays: bool = False,
    ) -> None:
        """Nothing yet; what is left out is added to `rejected`."""
        self.selection, self.sensor, self.rejected = selection, sensor, rejected
        self.rays = rays
        self._objects: dict[str, _Object] = {}
        self.damage = Damage(rejected)

    def wants(self, name: str, frame: int, *, category: str, source: str) -> bool:
        """Whether this frame of an object is to be cropped at all (`Selection.every`).

        `name`: of the object and of its track, unique in the data set; frames never go back.
        """
        seen = self._objects.setdefault(name, _Object(category, source))
        seen.offered += 1
        seen.last_frame = frame
        return (seen.offered - 1) % self.selection.every == 0

    def read(self, read: Callable[[], Scan | None], wanted: int) -> Scan | None:
        """What a frame's file holds; None, and counted why, where it is missing or damaged.

        `read` gives None where there is no file; for no object that is wanted it is not read.
        """
        if not wanted:
            return None
        try:
            scan = read()
        except BadInputError as error:
            self.damage.miss("scan", error, wanted)
            return None
        if scan is None:
            self.reject("scan: the frame has no LiDAR file", wanted)
        return scan

    def add(
        self,
        name: str,
        scan_name: str,
        points: Points,
        T_sensor_object: SE3 | None = None,
        place: np.ndarray | None = None,
        *,
        rays: Callable[[], SightLines | None] = lambda: None,
        label_size_m: tuple[float, float, float] | None = None,
    ) -> None:
        """Add one scan of an object that `wants` was asked about, or count why not.

        Args:
            name: of the object.
            scan_name: of the frame.
            points: on the object, sensor frame, metres.
            T_sensor_object: truth, one pose; for all scans of an object or for none.
            place: `(3,)` where the object stands in a frame that does not move, metres.
            rays: gives those that passed the object by; asked for only where they are kept.
            label_size_m: truth, length, width and height of the labelled box.
        """
        self.damage.read += 1
        objection = self.selection.objection_to_scan(points)
        if objection:
            self.reject(objection)
            return
        seen = self._objects[name]
        if scan_name in seen.names[-1:]:
            self.reject("scan: a second box of the object in one frame")
            return
        seen.scans.append(np.ascontiguousarray(points, np.float32))
        seen.names.append(scan_name)
        if T_sensor_object is not None:
            seen.poses.append(T_sensor_object)
        seen.rays.append(rays() if self.rays else None)
        seen.label_size_m = label_size_m
        if place is not None:
            seen.places.append(np.asarray(place, np.float64))

    def reject(self, reason: str, count: int = 1) -> None:
        """Count what is left out."""
        self.rejected[reason] = self.rejected.get(reason, 0) + count

    def finished(self, before: int | None = None) -> Iterator[Track]:
        """Tracks of the objects last seen before a frame; of all that are held by default.

        Raises:
            BadInputError: all is asked for, and of all frames none could be read.
        """
        if before is None:
            self.damage.settle()
        done = [n for n, o in self._objects.items() if before is None or o.last_frame < before]
        for name in done:
            seen = self._objects.pop(name)
            track = self._track(name, seen)
            places = np.stack(seen.places) if len(seen.places) == len(seen.scans) > 0 else None
            objection = self.selection.objection_to_track(track, places)
            if objection:
                self.reject(objection)
            else:
                yield track

    def _track(self, name: str, seen: _Object) -> Track:
        return Track(
            name=name,
            scans=tuple(seen.scans),
            scan_names=tuple(seen.names),
            sensor=self.sensor,
            category=seen.category,
            source=seen.source,
            T_sensor_object=stack(seen.poses) if seen.poses else None,
            rays=tuple(seen.rays),
            label_size_m=seen.label_size_m,
        )
