# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete shapes of the objects of a drive.

The network first looks at a few scans of each; what costs too much or has no size of a vehicle
is left there. Of the others some scans, spread over the track, are completed together.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wildshape.drives.completing.vehicles import shape_nats
from wildshape.drives.config import CompletionConfig, VehicleConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.complete_folder import OBJECTS, write_completed
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import write_json
from wildshape.io.boxes.detections import moved
from wildshape.records import Completion, Points

RULED_OUT, CATEGORY = "ruled_out.json", "car"


@dataclass(frozen=True)
class Completer:
    """What completes the objects of one drive.

    Attributes:
        predictor: completes and refines.
        drive: whose objects.
        cuts: folder of the clusters.
        folder: where a folder of each object is written.
        T_level_sensor: of a tilted sensor; None for one held level, as networks expect it.
        config: see there.
        vehicles: what speaks for one.
    """

    predictor: Predictor
    drive: Drive
    cuts: Path
    folder: Path
    T_level_sensor: SE3 | None
    config: CompletionConfig
    vehicles: VehicleConfig

    def missing(self, objects: list[Sightings]) -> list[Sightings]:
        """Those that are neither completed nor ruled out yet."""
        done = (OBJECTS, RULED_OUT)
        return [
            seen
            for seen in objects
            if not any((self.folder / seen.name / name).is_file() for name in done)
        ]

    def __call__(self, seen: Sightings) -> None:
        """Write an object as `complete --track` does, or `ruled_out.json`: what the looks said."""
        folder = self.folder / seen.name
        looks = fullest_of_parts(seen, self.config.looks)
        found = list(self._looker().complete_many(self._clouds(looks)))
        cost = min(look.cost for look in found)
        said = [shape_nats(look.cost, look.box.size, self.vehicles) for look in found]
        kept = [max(one, self.config.worst_nats) for one in said]
        nats = float(np.average(kept, weights=looks.points))
        if cost > self.config.worst_cost_m or nats < self.config.least_nats:
            write_json(folder / RULED_OUT, {"cost_m": cost, "nats": nats})
            return
        chosen = keyframes(seen, self.config)
        done = self.predictor.complete_track(self._clouds(chosen))
        track = chosen.track(self.cuts, self.drive, CATEGORY)
        T_level_sensor = self.T_level_sensor
        if T_level_sensor is not None:
            done = [_carried(one, T_level_sensor.inverse()) for one in done]
        write_completed(folder, track, done, self.predictor, self.cuts)

    def _looker(self) -> Predictor:
        """The same network, its answers not refined."""
        of = self.predictor
        return Predictor(of.network, of.settings, raw=True, config=of.config)

    def _clouds(self, seen: Sightings) -> list[Points]:
        clouds = seen.clouds(self.cuts)
        if self.T_level_sensor is None:
            return clouds
        return [self.T_level_sensor.apply_numpy(cloud) for cloud in clouds]


def keyframes(seen: Sightings, config: CompletionConfig) -> Sightings:
    """The scans that are completed together: the fullest of equal parts of the track."""
    span = seen.frames[-1] - seen.frames[0]
    return fullest_of_parts(seen, min(config.scans, span // config.ticks + 1), config.fewest_points)


def fullest_of_parts(seen: Sightings, parts: int, fewest_points: int = 0) -> Sightings:
    """Of each part of the track's time its fullest scan; poor ones only if all are."""
    first, span = seen.frames[0], seen.frames[-1] - seen.frames[0] + 1
    best: dict[int, int] = {}
    for place, (frame, points) in enumerate(zip(seen.frames, seen.points)):
        part = (frame - first) * parts // span
        if part not in best or points > seen.points[best[part]]:
            best[part] = place
    chosen = sorted(best.values())
    full = [place for place in chosen if seen.points[place] >= fewest_points]
    return seen.part(full or [max(chosen, key=lambda place: seen.points[place])])


def _carried(done: Completion, T_sensor_level: SE3) -> Completion:
    """A completion of the level frame in the sensor's."""
    return replace(
        done,
        points=T_sensor_level.apply_numpy(done.points),
        pose=T_sensor_level @ done.pose,
        box=moved(done.box, T_sensor_level),
    )
