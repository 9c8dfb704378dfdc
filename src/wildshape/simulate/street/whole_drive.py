# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated drive: full scans with the truth of every vehicle in them.

Scan i depends on (config, seed, i) alone, so that an interrupted drive goes on where it was.
"""

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from wildshape.arguments import check_fields, expect, expect_whole
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotations_about
from wildshape.simulate.sensor import SENSORS, SensorName, SpinningLidar
from wildshape.simulate.shapes.meshes import mesh_files, read_mesh
from wildshape.simulate.shapes.solid import Solid, union
from wildshape.simulate.shapes.vehicle import random_vehicle
from wildshape.simulate.street.roadside import roadside
from wildshape.simulate.street.street import LANE_M, LEAD_M, Actor, Street, random_street
from wildshape.simulate.street.sweep import (
    NOBODY,
    Echoes,
    Mover,
    Surfaces,
    cast_turn,
    intensity,
    pulses,
    returned,
    surfaces,
)
from wildshape.simulate.street.traffic import traffic

PERIOD_S = 0.1
_BLOCK_M = 40.0
_TILT_DEG, _SWAY_DEG = 0.5, 0.25


@dataclass(frozen=True)
class StreetConfig:
    """What to simulate.

    Attributes:
        scans: how many, ten a second.
        sensor: what scans.
        meshes: folder of the user's meshes (x forward, z up, metres) in place of our vehicles.
        speed: of the sensor's vehicle, mean, metres a second; None: drawn from 4 to 10; 0: it
            stands still.
        compensated: give points where they would be seen from the sensor's place at the scan's
            middle, as nuScenes, Waymo and Argoverse 2 do; else each as the sensor measured it.
        dropout: share of pulses lost at random.
        noise_m: sigma of the range noise, metres; None: the sensor's own.
    """

    scans: int = 100
    sensor: SensorName = "hdl64"
    meshes: Path | None = None
    speed: float | None = None
    compensated: bool = False
    dropout: float = 0.05
    noise_m: float | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated.

        Raises:
            BadInputError: a number is out of range, or the sensor is no LiDAR.
        """
        lidars = [name for name, one in SENSORS.items() if isinstance(one, SpinningLidar)]
        if self.sensor not in lidars:
            raise BadInputError(
                f"sensor is {self.sensor!r}; a drive needs a LiDAR: one of {', '.join(lidars)}."
            )
        check_fields(self)
        if self.scans < 1:
            raise BadInputError(f"scans is {self.scans}, expected at least 1.")
        if self.speed is not None and not 0 <= self.speed <= 40:
            raise BadInputError(f"speed is {self.speed}, expected 0 to 40 metres a second.")
        if not 0 <= self.dropout < 1:
            raise BadInputError(f"dropout is {self.dropout}, expected 0 to below 1.")
        if not self.noise >= 0:
            raise BadInputError(f"noise_m is {self.noise_m}, expected 0 or more metres.")

    @property
    def lidar(self) -> SpinningLidar:
        """The sensor itself."""
        sensor = SENSORS[self.sensor]
        assert isinstance(sensor, SpinningLidar)
        return sensor

    @property
    def noise(self) -> float:
        """Sigma of the range noise, metres."""
        return self.lidar.noise_m if self.noise_m is None else self.noise_m


@dataclass(frozen=True)
class TrueBox:
    """A vehicle or a pedestrian in one scan.

    Attributes:
        track: number, unique in the drive.
        kind: `Car`, `Van`, `Truck` or `Pedestrian`.
        size: along its own x (forward), y (left), z (up), metres; a vehicle's without mirrors.
        T_sensor_object: `(4, 4)`, origin at the box's centre, when the beam passed that centre.
        points: how many of the scan's points lie on it.
    """

    track: int
    kind: str
    size: tuple[float, float, float]
    T_sensor_object: np.ndarray
    points: int
    moving: bool


@dataclass(frozen=True)
class DriveScan:
    """One scan.

    Attributes:
        points: `(n, 3)` float32, sensor frame, metres, ring after ring.
        intensity: `(n,)` float32, 0 to 1.
        times: `(n,)` float32, seconds from the scan's middle.
        owner: `(n,)` int64, track number of what each point lies on; -1: no vehicle, no person.
        boxes: everybody with a point in the scan, by track number.
        time: of the scan's middle, when the beam faces forward, seconds.
        T_world_sensor: `(4, 4)` at that time.
    """

    points: np.ndarray
    intensity: np.ndarray
    times: np.ndarray
    owner: np.ndarray
    boxes: tuple[TrueBox, ...]
    time: float
    T_world_sensor: np.ndarray


class WholeDrive:
    """A street with all that is on it, and the scans taken there."""

    def __init__(self, config: StreetConfig, seed: int) -> None:
        """Lay out the street.

        Raises:
            BadInputError: a mesh that cannot be used, or a negative seed.
            MissingExtraError: embreex is not installed.
        """
        self.config = expect(config, StreetConfig, "config")
        self.seed = expect_whole(seed, "seed")
        seconds = config.scans * PERIOD_S
        files = mesh_files(config.meshes) if config.meshes else None
        vehicles = partial(_drawn_mesh, files) if files else random_vehicle
        self.street = random_street(seed, seconds, config.speed, vehicles)
        end = float(self.street.ego.at(seconds)) + LEAD_M
        self.actors = traffic(self.street, end, seconds, seed)
        self._parked = [actor for actor in self.actors if not actor.moving]
        free = np.concatenate((_road(self.street, end), *map(self._circle, self._parked)))
        rng = np.random.default_rng([seed, 3])
        self._things = list(roadside(self.street, end, free, rng))
        self._sway = rng.uniform(0, 2 * np.pi, 4)
        self._tilt = np.radians(rng.normal(0.0, _TILT_DEG, 2))
        self._turn = pulses(config.lidar, PERIOD_S)
        self._blocks = lru_cache(maxsize=1)(self._block)
        self._alone = lru_cache(maxsize=128)(self._surfaces_of)

    def scan(self, number: int) -> DriveScan:
        """The scan of a number, from 0; the same whenever it is asked for."""
        rng = np.random.default_rng([self.seed, 4, number])
        middle = number * PERIOD_S
        times = middle + self._turn.times
        T_world_sensor = self.sensor_pose(times)
        still = self._blocks(int(np.floor(self.street.ego.at(middle) / _BLOCK_M)))
        movers = self._movers(times, T_world_sensor)
        echoes = cast_turn(still, movers, self._turn, T_world_sensor)
        glass = float(np.random.default_rng([self.seed, 5]).uniform(0.05, 0.3))
        kept = returned(echoes, self.config.lidar, self.config.dropout, glass, rng)
        return self._scan(echoes, kept, middle, T_world_sensor, rng)

    def sensor_pose(self, times: np.ndarray) -> np.ndarray:
        """`(n, 4, 4)` T_world_sensor at times in seconds: mounted a little askew, and swaying."""
        ego = self.street.ego
        T = self.street.standing(ego.at(times), -LANE_M / 2, 0.0, self.config.lidar.height_m)
        sway = np.radians(_SWAY_DEG) * np.sin(
            2 * np.pi * np.outer((0.9, 1.3), times) + self._sway[:2, None]
        )
        pitch, roll = self._tilt[:, None] + (0.0 if ego.speed == 0 else 1.0) * sway
        T[:, :3, :3] = T[:, :3, :3] @ (rotations_about(1, pitch) @ rotations_about(0, roll))
        return T

    def _scan(
        self,
        echoes: Echoes,
        kept: np.ndarray,
        middle: float,
        T_world_sensor: np.ndarray,
        rng: np.random.Generator,
    ) -> DriveScan:
        column = np.nonzero(kept)[1]
        reach = echoes.distance[kept]
        reach = reach + self.config.noise * rng.standard_normal(len(reach))
        points = self._turn.directions[kept] * reach[:, None]
        T_world_middle = self.sensor_pose(np.array((middle,)))[0]
        if self.config.compensated:
            T = np.linalg.inv(T_world_middle) @ T_world_sensor[column]
            points = np.einsum("nij,nj->ni", T[:, :3, :3], points) + T[:, :3, 3]
        owner = echoes.owner[kept]
        return DriveScan(
            points.astype(np.float32),
            intensity(echoes)[kept],
            self._turn.times[column].astype(np.float32),
            owner,
            self._boxes(owner, middle),
            middle,
            T_world_middle,
        )

    def _boxes(self, owner: np.ndarray, middle: float) -> tuple[TrueBox, ...]:
        tracks, counts = np.unique(owner[owner >= 0], return_counts=True)
        return tuple(
            self._box(self.actors[track], int(count), middle)
            for track, count in zip(tracks, counts)
        )

    def _box(self, actor: Actor, points: int, middle: float) -> TrueBox:
        """Where the beam met an actor: at the time when it passed the middle of its box."""
        time = middle
        for _ in range(4):
            T_sensor_object = self._seen(actor, time, time)
            turned = np.arctan2(T_sensor_object[1, 3], T_sensor_object[0, 3]) / (2 * np.pi)
            time = middle + turned * PERIOD_S
        T = self._seen(actor, time, middle if self.config.compensated else time)
        size, left = self.street.label(actor)
        T[:3, 3] += left * T[:3, 1]
        return TrueBox(actor.track, actor.kind, size, T, points, actor.moving)

    def _seen(self, actor: Actor, time: float, sensor_time: float) -> np.ndarray:
        """`(4, 4)` T_sensor_object of an actor at one time, a sensor at another."""
        T_world_object = self.street.pose(actor, np.array((time,)))[0]
        return np.linalg.inv(self.sensor_pose(np.array((sensor_time,)))[0]) @ T_world_object

    def _movers(self, times: np.ndarray, T_world_sensor: np.ndarray) -> list[Mover]:
        middle, place = times[len(times) // 2], T_world_sensor[len(times) // 2, :3, 3]
        movers = []
        for actor in self.actors:
            if not actor.moving or abs(actor.motion.at(middle) - self.street.ego.at(middle)) > 250:
                continue
            away = self.street.pose(actor, np.array((middle,)))[0, :3, 3] - place
            if np.linalg.norm(away) < self.config.lidar.max_range_m:
                alone, reach = self._alone(actor.track)
                movers.append(Mover(alone, reach, self.street.pose(actor, times)))
        return movers

    def _surfaces_of(self, track: int) -> tuple[Surfaces, float]:
        shape = self.street.shape(self.actors[track])
        return surfaces([shape], [track]), float(np.linalg.norm(shape.vertices, axis=1).max())

    def _block(self, number: int) -> Surfaces:
        """What stands around a block of the street, as one scene."""
        solids, owners, ground = self._solids(number)
        return surfaces(solids, owners, ground)

    def _solids(self, number: int) -> tuple[list[Solid], list[int], int]:
        """The solids of a block, whose they are, and how many of them, the first, are ground."""
        low, high = number * _BLOCK_M - LEAD_M + 2, (number + 1) * _BLOCK_M + LEAD_M - 2
        near = [actor for actor in self._parked if low < actor.motion.start < high]
        things = [thing for s, thing in self._things if low < s < high]
        ground = self.street.ground(low, high)
        others = [*ground, *([union(things)] if things else [])]
        solids = [*others, *(self._placed(actor, 0.0) for actor in near)]
        return solids, [NOBODY] * len(others) + [actor.track for actor in near], len(ground)

    def _placed(self, actor: Actor, time: float) -> Solid:
        T = self.street.pose(actor, np.array((time,)))[0]
        shape = self.street.shape(actor)
        return replace(shape, vertices=shape.vertices @ T[:3, :3].T + T[:3, 3])

    def _circle(self, actor: Actor) -> np.ndarray:
        x, y = self.street.pose(actor, np.zeros(1))[0, :2, 3]
        return np.array(((x, y, np.hypot(*actor.size[:2]) / 2),))


def _drawn_mesh(files: tuple[Path, ...], rng: np.random.Generator) -> Solid:
    """One of the user's."""
    return read_mesh(files[int(rng.integers(len(files)))], metres=True)


def _road(street: Street, end: float) -> np.ndarray:
    """`(n, 3)` circles that cover road and pavements."""
    middle = street.middle(-2 * LEAD_M, end + LEAD_M)
    return np.column_stack((middle, np.full(len(middle), street.half_m + street.walk_m)))
