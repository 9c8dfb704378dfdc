# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete shapes of the objects of a drive.

Of each some scans are chosen, spread over the track. The network looks at the fullest ones first;
what costs too much or has no size of a vehicle is left there, unless it drives. The others are
completed together.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from wildshape.drives.completing.batched_inference import box_of, completed, looks_at
from wildshape.drives.completing.deskewing import deskewed
from wildshape.drives.completing.driving import drives
from wildshape.drives.completing.vehicles import shape_nats, vehicle_sized
from wildshape.drives.config import DriveConfig
from wildshape.drives.object_config import CompletionConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.rays import RayCutter
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.folders.complete_folder import (
    COMPLETED,
    OBJECTS,
    POSES,
    objects_of,
)
from wildshape.inference.predictor import Predictor
from wildshape.inference.single_scans import Looked
from wildshape.inference.tracks.pose_outliers import SensorMotion
from wildshape.io.atomic import write_json
from wildshape.io.boxes.detections import moved
from wildshape.io.output import file_name, remove_leftovers
from wildshape.io.poses import write_poses
from wildshape.io.scans.writers import write_cloud
from wildshape.records import Completion, Points

RULED_OUT, CATEGORY = "ruled_out.json", "car"
_GROUP = 5  # objects that are worked on together
_USUAL_S = 0.1  # between scans, where no times are known


@dataclass
class _Candidate:
    """An object that may be a vehicle.

    Attributes:
        scans: in which it was seen.
        chosen: in the frames that may be completed.
        clouds: its points in them, level frames.
        order: in which they are looked at.
        rays: beside it in these frames, level frames too, by place; of whole tracks alone.
        looks: the network's, in that order.
        nats: what each of these says for a vehicle.
    """

    scans: int
    chosen: Sightings
    clouds: list[Points]
    order: list[int]
    rays: dict[int, SightLines | None] = field(default_factory=dict)
    looks: list[Looked] = field(default_factory=list)
    nats: list[float] = field(default_factory=list)

    @property
    def single(self) -> bool:
        """Whether one scan alone is completed."""
        return len(self.looks) < 2

    @property
    def looked_at(self) -> Sightings:
        """The object in the frames that were looked at."""
        return self.chosen.part(self.places)

    @property
    def places(self) -> list[int]:
        """Of the frames that were looked at, in time order."""
        return sorted(self.order[: len(self.looks)])

    @property
    def in_time(self) -> list[Looked]:
        """The looks in time order."""
        return [look for _, look in sorted(zip(self.order, self.looks), key=lambda both: both[0])]

    @property
    def cost(self) -> float:
        """The least of the looks, metres."""
        return min(float(look.found.cost) for look in self.looks)

    @property
    def said(self) -> float:
        """What the looks say for a vehicle on average, the fuller the heavier."""
        return float(np.average(self.nats, weights=[len(look.scans[0]) for look in self.looks]))


@dataclass(frozen=True)
class Completer:
    """What completes the objects of one drive, some at a time: networks are faster in batches.

    Attributes:
        cuts: folder of the clusters.
        folder: where a folder of each object is written.
        T_level_sensor: of a tilted sensor; None for one held level, as networks expect it.
        T_world_level: of every frame, from the frame that networks see to the level world.
    """

    predictor: Predictor
    drive: Drive
    cuts: Path
    folder: Path
    T_level_sensor: SE3 | None
    T_world_level: SE3
    config: DriveConfig

    @cached_property
    def rays(self) -> RayCutter:
        """Cuts those beside the objects."""
        return RayCutter(self.drive, self.cuts)

    def groups(self, objects: list[Sightings]) -> list[list[Sightings]]:
        """The objects in groups that are worked on together, whatever was done before."""
        return [objects[i : i + _GROUP] for i in range(0, len(objects), _GROUP)]

    def missing(self, objects: list[Sightings]) -> list[list[Sightings]]:
        """The groups of which one is neither completed nor ruled out yet."""
        done = (OBJECTS, RULED_OUT)
        return [
            group
            for group in self.groups(objects)
            if not all(any((self.folder / one.name / n).is_file() for n in done) for one in group)
        ]

    def __call__(self, group: list[Sightings]) -> None:
        """Write objects as `complete --track` does, or `ruled_out.json`: what the looks said.

        The network is asked of the fullest scan of each, then of some spread over its time, then of
        all where these do not speak against a vehicle, or it drives.
        """
        began, of = time.perf_counter(), self.config.completion
        every = [self._candidate(seen) for seen in group]
        for count, cost_m, nats in (
            (1, of.hopeless_cost_m, -math.inf),
            (of.looks, of.worst_cost_m, of.least_nats),
        ):
            self._look(every, count)
            every = [one for one in every if self._may_be_a_vehicle(one, cost_m, nats)]
        sure = (one for one in every if one.said >= of.doubtful_nats or self._drives(one))
        self._look(list(sure), None)
        if of.rays:
            self._cut_rays([one for one in every if len(one.looks) > 1])
        alone = {single: self._completed(every, single) for single in (False, True)}
        together = [self._together(alone[one.single], one) for one in every]
        seconds = (time.perf_counter() - began) / max(sum(map(len, together)), 1)
        for one, done in zip(every, together):
            self._write(one.looked_at, [replace(scan, seconds=seconds) for scan in done])

    def _candidate(self, seen: Sightings) -> _Candidate:
        chosen = keyframes(seen, self.config.completion)
        order = order_of_looks(chosen, self.config.completion.looks)
        return _Candidate(len(seen.frames), chosen, self._clouds(chosen), order)

    def _completed(self, every: list[_Candidate], single: bool) -> Iterator[Completion]:
        """Each scan on its own, of objects with one alone or with several."""
        looks = [look for one in every if one.single is single for look in one.in_time]
        return completed(looks, self.predictor, dense=single)

    def _together(self, alone: Iterator[Completion], one: _Candidate) -> list[Completion]:
        """The next of those completed alone are of this object."""
        done = list(islice(alone, len(one.looks)))
        scans = [look.scans[0] for look in one.in_time]
        rays = [one.rays.get(i) for i in one.places] if self.config.completion.rays else ()
        frames = list(one.looked_at.frames)
        seconds = torch.tensor(self._since_first(frames), dtype=torch.float32)
        motion = SensorMotion(self.T_world_level.rotation[frames].double(), seconds)
        return list(self.predictor.put_together(done, scans, rays, motion))

    def _since_first(self, frames: list[int]) -> Float[np.ndarray, "k"]:
        """The scans' times since the first of them, seconds."""
        at = np.array(self.drive.times or _USUAL_S * np.array(self.drive.ticks))
        return at[frames] - at[frames[0]]

    def _look(self, every: list[_Candidate], count: int | None) -> None:
        """Look at the first so many scans of each."""
        asked = [(one, i) for one in every for i in one.order[len(one.looks) : count]]
        found = looks_at([one.clouds[i] for one, i in asked], self.predictor)
        for (one, _), look in zip(asked, found):
            one.looks.append(look)

    def _cut_rays(self, every: list[_Candidate]) -> None:
        """The rays beside objects in the frames that were looked at."""
        asked = [(one, i) for one in every for i in one.places]
        cut = self.rays.of([(one.chosen, i) for one, i in asked])
        for (one, i), rays in zip(asked, cut):
            one.rays[i] = self._level(rays)

    def _level(self, rays: SightLines | None) -> SightLines | None:
        T_level_sensor = self.T_level_sensor
        if rays is None or T_level_sensor is None:
            return rays
        return rays.moved(T_level_sensor.rotation.numpy(), T_level_sensor.translation.numpy())

    def _may_be_a_vehicle(self, one: _Candidate, worst_cost_m: float, least_nats: float) -> bool:
        """Whether its looks do not speak against it; if they do, that is written."""
        said: dict[str, float] = {"cost_m": one.cost}
        if one.cost <= worst_cost_m or self._is_solid(one):  # only then is it worth fitting boxes
            self._listen(one)
            if one.said >= least_nats:
                return True
            said["nats"] = one.said
        if self._drives(one):
            self._listen(one)
            return True
        write_json(self.folder / one.chosen.name / RULED_OUT, said)
        return False

    def _drives(self, one: _Candidate) -> bool:
        frames = list(one.chosen.frames)
        ticks = np.take(self.drive.ticks, frames)
        T_world_level = self.T_world_level[torch.tensor(frames)]
        return drives(one.clouds, T_world_level, ticks, self.config.driving)

    def _is_solid(self, one: _Candidate) -> bool:
        """Whether its own points are of a vehicle's size, long enough to be believed."""
        of = self.config.completion
        if one.scans < of.solid_scans or one.cost > of.solid_cost_m:
            return False
        return vehicle_sized(one.clouds, self.config.vehicles)

    def _listen(self, one: _Candidate) -> None:
        """What the looks say for a vehicle, of those that were not asked yet."""
        for look in one.looks[len(one.nats) :]:
            cost, size = float(look.found.cost), box_of(look, self.predictor).size
            said = shape_nats(cost, size, self.config.vehicles)
            one.nats.append(max(said, self.config.completion.worst_nats))

    def _write(self, chosen: Sightings, done: list[Completion]) -> None:
        if self.T_level_sensor is not None:
            done = [_carried(one, self.T_level_sensor.inverse()) for one in done]
        track = chosen.track(self.cuts, self.drive, CATEGORY)
        folder = self.folder / chosen.name
        for name, one in zip(track.scan_names, done, strict=True):
            write_cloud(folder / COMPLETED / f"{file_name(name)}.ply", one.points)
        write_poses(folder / POSES, stack([one.pose for one in done]))
        remove_leftovers(folder)  # of a worker that was killed over this object
        said = objects_of(track, done, self.predictor, self.cuts, together=True)
        write_json(folder / OBJECTS, said)  # last: it says that the object is done

    def _clouds(self, seen: Sightings) -> list[Points]:
        clouds, frames = seen.clouds(self.cuts), list(seen.frames)
        if self.T_level_sensor is not None:
            clouds = [self.T_level_sensor.apply_numpy(cloud) for cloud in clouds]
        T_world_level = self.T_world_level[torch.tensor(frames)]
        known = seen.seconds(self.cuts), self._since_first(frames), T_world_level
        return deskewed(clouds, *known, self.config.deskewing)


def order_of_looks(seen: Sightings, parts: int) -> list[int]:
    """Places of an object's frames: the fullest of each of some parts first, the fullest first."""
    places = np.arange(len(seen.frames))
    some = [part.tolist() for part in np.array_split(places, min(parts, len(places)))]
    first = [max(part, key=lambda place: seen.points[place]) for part in some]
    first.sort(key=lambda place: -seen.points[place])
    return [*first, *(place for place in places.tolist() if place not in first)]


def keyframes(seen: Sightings, config: CompletionConfig) -> Sightings:
    """The scans that are completed together: the fullest of equal parts of the track."""
    span = seen.frames[-1] - seen.frames[0]
    long = min(config.most_scans, span // config.most_ticks + 1)
    parts = max(min(config.scans, span // config.ticks + 1), long)
    return fullest_of_parts(seen, parts, config.fewest_points)


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
