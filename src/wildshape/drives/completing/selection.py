# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From completed objects to vehicles: judged, clusters gathered, walls and oneself left out."""

from dataclasses import dataclass
from pathlib import Path

from wildshape.drives.completing.cluster_association import associate
from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.merging import Places
from wildshape.drives.completing.own_vehicle import carries_sensor
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.completing.surroundings import InOrder, crowded
from wildshape.drives.completing.vehicles import Judged, judge, refused, stated
from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive


@dataclass(frozen=True)
class Selector:
    """Selects the vehicles of a drive.

    Attributes:
        cuts: folder of the clusters.
        tracked: whether detections brought the tracks, which then stay as they are.
        in_order: looks at the scans.
    """

    drive: Drive
    cuts: Path
    config: DriveConfig
    tracked: bool
    in_order: InOrder

    def __call__(
        self, completed: list[Completed], places: Places
    ) -> tuple[list[Completed], list[Judged]]:
        """The vehicles with all that is theirs, and what is said of every object."""
        turns = places.turns
        own = {one.seen.name for one in completed if self.is_own(one, turns)}
        others = [one for one in completed if one.seen.name not in own]
        said = judge(others, places, self.config.vehicles)
        sure = {one.name: one.confidence for one in said if not one.reasons}
        found = [one for one in completed if one.seen.name in sure]
        if not self.tracked:
            found, why = self.gathered(found, sure, turns)
            said = refused(said, why)
        return found, said + [Judged(name, 0.0, ("own_vehicle",)) for name in sorted(own)]

    def is_own(self, one: Completed, turns: Turns) -> bool:
        """Whether it is of the vehicle that carries the sensor."""
        nearest_m = self.config.ground.nearest_m
        known = self.cuts, turns.T_level_sensor, nearest_m, self.config.own_vehicle
        return carries_sensor(one.seen, *known)

    def gathered(
        self, found: list[Completed], sure: dict[str, float], turns: Turns
    ) -> tuple[list[Completed], dict[str, str]]:
        """Vehicles with more clusters, the surest first, and why some are none after all."""
        found = sorted(found, key=lambda one: -sure[one.seen.name])
        associated = associate(found, self.cuts, turns, self.config)
        around = self.config.surroundings
        doubtful = [one for one in associated.vehicles if stated(one, sure) < around.sure]
        crowd = crowded(self.drive.scan, doubtful, turns, around, self.in_order)
        found = [one for one in associated.vehicles if one.seen.name not in crowd]
        return found, associated.parts | dict.fromkeys(crowd, "crowded")
