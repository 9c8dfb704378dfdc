# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Crops of objects, as they come frame by frame, gathered into tracks."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from wildshape.datasets.tracks.damage import Damage
from wildshape.datasets.tracks.selection import Selection
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Points, Sensor, Track


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


class Gathering:
    """Collects the scans of many objects at once; holds only those that may still be seen.

    Attributes:
        rejected: how much was left out, by reason (see `Source`).
        damage: frames that could not be read.
    """

    def __init__(self, selection: Selection, sensor: Sensor) -> None:
        self.selection, self.sensor = selection, sensor
        self.rejected: Counter[str] = Counter()
        self._objects: dict[str, _Object] = {}
        self.damage = Damage(self.rejected)

    def wants(self, name: str, frame: int, *, category: str, source: str) -> bool:
        """Whether this frame of an object is to be cropped at all (`Selection.every`).

        Args:
            name: of the object and of its track, unique in the data set.
            frame: number of the frame; frames never go back.
            category: of the object.
            source: where it comes from, in words.
        """
        seen = self._objects.setdefault(name, _Object(category, source))
        seen.offered += 1
        seen.last_frame = frame
        return (seen.offered - 1) % self.selection.every == 0

    def add(
        self,
        name: str,
        scan_name: str,
        points: Points,
        T_sensor_object: SE3 | None = None,
        place: np.ndarray | None = None,
    ) -> None:
        """Add one scan of an object that `wants` was asked about, or count why not.

        Args:
            name: of the object.
            scan_name: of the frame.
            points: on the object, sensor frame, metres.
            T_sensor_object: truth, one pose; for all scans of an object or for none.
            place: `(3,)` where the object stands in a frame that does not move, metres.
        """
        self.damage.read += 1
        objection = self.selection.objection_to_scan(points)
        if objection:
            self.rejected[objection] += 1
            return
        seen = self._objects[name]
        seen.scans.append(np.ascontiguousarray(points, np.float32))
        seen.names.append(scan_name)
        if T_sensor_object is not None:
            seen.poses.append(T_sensor_object)
        if place is not None:
            seen.places.append(np.asarray(place, np.float64))

    def miss(self, objects: int, error: BadInputError) -> None:
        """Go on without a frame whose file is damaged, of which objects were to be cut out."""
        self.damage.miss("scan", error, objects)

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
                self.rejected[objection] += 1
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
        )
