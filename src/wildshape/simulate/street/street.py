# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A random street: its path, its ground, and how things stand and move on it.

World frame: metres, z up. Places on the street are `s`, metres along its middle from where the
drive begins, and `l`, metres to the left of it. Traffic keeps to the right.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wildshape.geometry.box import body_sides
from wildshape.simulate.shapes.solid import Solid, cylinder, solid
from wildshape.simulate.truth import on_surface

LEAD_M = 100.0
"""Metres of street before the start of the drive, and after its end."""

LANE_M = 3.3
_PARKING_M, _KERB_M, _CROSSFALL, _PLOT_M = 2.7, 0.12, 0.02, 0.2
_STEP_M, _SMOOTH_M = 0.5, 8.0
_TERRAIN_STEP_M, _TERRAIN_M = 2.0, 85.0
_WHEELS_M = np.array(((1.3, 0.0), (-1.3, 0.0), (0.0, 0.7), (0.0, -0.7)))
Vehicles = Callable[[np.random.Generator], Solid]


@dataclass(frozen=True)
class Motion:
    """Metres along the street over time: `start + speed t`, and a swing about it.

    Attributes:
        start: at time 0, metres.
        speed: mean, metres a second; negative against the street's direction.
        swing: amplitude, metres.
        period: of the swing, seconds.
        phase: of the swing, radians.
    """

    start: float
    speed: float = 0.0
    swing: float = 0.0
    period: float = 10.0
    phase: float = 0.0

    def at(self, time: np.ndarray | float) -> np.ndarray:
        """Metres along the street at times in seconds."""
        time = np.asarray(time, float)
        turn = 2 * np.pi * time / self.period + self.phase
        return np.asarray(self.start + self.speed * time + self.swing * np.sin(turn))


@dataclass(frozen=True)
class Actor:
    """A vehicle or a pedestrian.

    Attributes:
        track: number, unique in the drive.
        kind: `Car`, `Van`, `Truck` or `Pedestrian`, as KITTI names them.
        size: of its box, metres.
        lateral: metres to the left of the street's middle.
        heading: turn against the street's direction, radians.
        seed: what its shape is drawn from.
    """

    track: int
    kind: str
    size: tuple[float, float, float]
    motion: Motion
    lateral: float
    heading: float
    seed: tuple[int, ...]

    @property
    def moving(self) -> bool:
        """Whether it ever moves."""
        return self.motion.speed != 0


@dataclass(frozen=True)
class Street:
    """A street without what stands on it.

    Attributes:
        path: `(n, 4)` s, x, y, yaw every half metre.
        waves: `(w, 4)` relief: wave vector x, y (radians a metre), phase, amplitude in metres.
        half_m: from the middle to the kerb.
        walk_m: width of the pavement.
        ego: how the sensor's own vehicle moves, in the right lane.
        vehicles: draws the shape of one.
    """

    path: np.ndarray
    waves: np.ndarray
    half_m: float
    walk_m: float
    ego: Motion
    vehicles: Vehicles

    def height(self, s: np.ndarray, lateral: np.ndarray) -> np.ndarray:
        """Of the ground: relief, a road that falls to both sides, kerbs, pavements."""
        xy, _ = _places(self.path, s, lateral)
        return relief(self.waves, xy) + _profile(np.abs(lateral), self.half_m, self.walk_m)

    def standing(self, s: np.ndarray, lateral: float, heading: float, lift: float) -> np.ndarray:
        """`(n, 4, 4)` T_world_thing of what stands on the ground, leaning as the ground does.

        Args:
            s: `(n,)` metres along the street.
            lateral: metres to the left.
            heading: against the street's direction, radians.
            lift: of the thing's origin above the ground, metres.
        """
        s = np.atleast_1d(np.asarray(s, float))
        cos, sin = np.cos(heading), np.sin(heading)
        around = _WHEELS_M @ np.array(((cos, sin), (-sin, cos)))
        height = self.height(s[:, None] + around[:, 0], lateral + around[:, 1])
        xy, yaw = _places(self.path, s, np.full(len(s), lateral))
        yaw = yaw + heading
        ahead = np.stack((np.cos(yaw), np.sin(yaw), (height[:, 0] - height[:, 1]) / 2.6), -1)
        left = np.stack((-np.sin(yaw), np.cos(yaw), (height[:, 2] - height[:, 3]) / 1.4), -1)
        ahead /= np.linalg.norm(ahead, axis=1)[:, None]
        up = np.cross(ahead, left)
        up /= np.linalg.norm(up, axis=1)[:, None]
        T = np.tile(np.eye(4), (len(s), 1, 1))
        T[:, :3, :3] = np.stack((ahead, np.cross(up, ahead), up), -1)
        T[:, :2, 3], T[:, 2, 3] = xy, height.mean(1)
        T[:, :3, 3] += lift * up
        return T

    def pose(self, actor: Actor, time: np.ndarray) -> np.ndarray:
        """`(n, 4, 4)` T_world_object at times in seconds; origin at the box's centre."""
        s = actor.motion.at(time)
        return self.standing(s, actor.lateral, actor.heading, actor.size[2] / 2)

    def shape(self, actor: Actor) -> Solid:
        """An actor's surface in its own frame, box centre at the origin."""
        return _shape(self.vehicles, actor.kind, actor.seed)

    def label(self, actor: Actor) -> tuple[tuple[float, float, float], float]:
        """Its size as data sets label it, without mirrors, and how far left its middle then lies.

        Metres; the body of a vehicle with one mirror is beside the middle of its own box.
        """
        if actor.kind == "Pedestrian":
            return actor.size, 0.0
        length, _, height = actor.size
        right, left = _body_sides(self.vehicles, actor.kind, actor.seed)
        return (length, left - right, height), (left + right) / 2

    def ground(self, low: float, high: float) -> list[Solid]:
        """The road between two places along it, and the terrain around."""
        s = np.arange(low, high + 1.0)
        return [self._road(s), self._terrain(s)]

    def is_straight(self, s: float) -> bool:
        """Whether the street keeps its direction within 6 m of a place."""
        yaw = np.interp((s - 6.0, s + 6.0), self.path[:, 0], self.path[:, 3])
        return bool(abs(yaw[1] - yaw[0]) < 0.01)

    def middle(self, low: float, high: float) -> np.ndarray:
        """`(n, 2)` places of its middle, a metre apart."""
        return _places(self.path, np.arange(low, high), np.zeros(()))[0]

    def _road(self, s: np.ndarray) -> Solid:
        half, walk = self.half_m, self.walk_m
        side = np.array(
            (0.3 * half, 0.7 * half, half - 1e-3, half + 1e-3, half + walk, half + walk + 2.5)
        )
        lateral = np.concatenate((-side[::-1], (0.0,), side))
        grid_s, grid_l = (axis.ravel() for axis in np.meshgrid(s, lateral, indexing="ij"))
        xy, _ = _places(self.path, grid_s, grid_l)
        points = np.column_stack((xy, self.height(grid_s, grid_l)))
        return _surface(points, len(s), len(lateral))

    def _terrain(self, s: np.ndarray) -> Solid:
        """A grid that dives under the road, and meets it beyond the pavements."""
        middle, _ = _places(self.path, s, np.zeros(len(s)))
        axes = [
            np.arange(low - _TERRAIN_M, high + _TERRAIN_M, _TERRAIN_STEP_M)
            for low, high in zip(middle.min(0), middle.max(0))
        ]
        xy = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
        under = _distance(xy, middle) < self.half_m + self.walk_m + 0.5
        height = relief(self.waves, xy) + np.where(under, -0.4, _PLOT_M)
        return _surface(np.column_stack((xy, height)), len(axes[0]), len(axes[1]))


def relief(waves: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Height of the bare land at places `(..., 2)`, metres."""
    turn = xy @ waves[:, :2].T + waves[:, 2]
    return np.sin(turn) @ waves[:, 3]


def _profile(beside: np.ndarray, half: float, walk: float) -> np.ndarray:
    """Height of the street above the bare land, `beside` metres from its middle."""
    gutter = 0.05
    pavement = gutter + _KERB_M + 0.015 * (beside - half)
    on_road = beside < half
    height = np.where(on_road, gutter + _CROSSFALL * (half - beside), pavement)
    return np.where(beside > half + walk, _PLOT_M, height)


def _places(path: np.ndarray, s: np.ndarray, lateral: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`(..., 2)` places and yaw of (s, l)."""
    x, y, yaw = (np.interp(s, path[:, 0], path[:, k]) for k in (1, 2, 3))
    return np.stack((x - lateral * np.sin(yaw), y + lateral * np.cos(yaw)), -1), yaw


def _distance(xy: np.ndarray, path: np.ndarray) -> np.ndarray:
    """From each place to the nearest of the path's, metres."""
    nearest = np.empty(len(xy))
    for start in range(0, len(xy), 4096):
        part = xy[start : start + 4096, None] - path
        nearest[start : start + 4096] = np.sqrt((part**2).sum(-1).min(1))
    return nearest


def _surface(points: np.ndarray, rows: int, columns: int) -> Solid:
    """A sheet over a grid of points."""
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack((a, b, c, a, c, d), -1).reshape(-1, 3)
    return solid(points, faces)


@lru_cache(maxsize=256)
def _body_sides(vehicles: Vehicles, kind: str, seed: tuple[int, ...]) -> tuple[float, float]:
    points, _ = on_surface(_shape(vehicles, kind, seed), 8192, np.random.default_rng(0))
    return body_sides(points[:, 1])


@lru_cache(maxsize=256)
def _shape(vehicles: Vehicles, kind: str, seed: tuple[int, ...]) -> Solid:
    rng = np.random.default_rng(seed)
    return _pedestrian(rng) if kind == "Pedestrian" else vehicles(rng).centred()


def _pedestrian(rng: np.random.Generator) -> Solid:
    radius, height = rng.uniform(0.2, 0.32), rng.uniform(1.2, 1.9)
    top = np.array((0.0, 0.0, height))
    return cylinder(np.zeros(3), top, (radius, radius, 0.8 * radius, 0.5 * radius), 12).centred()


def random_street(seed: int, seconds: float, speed: float | None, vehicles: Vehicles) -> Street:
    """A street that is long enough for a drive.

    `speed`: of the sensor's vehicle, metres a second; None: drawn from 4 to 10; 0: it stands.
    """
    rng = np.random.default_rng([seed, 0])
    drawn = float(rng.uniform(4.0, 10.0))
    mean = drawn if speed is None else speed
    ego = Motion(0.0, mean, 0.4 * mean, 10.0, float(rng.uniform(0, 2 * np.pi)))
    walk = float(rng.uniform(2.4, 3.4))
    path = _path(float(ego.at(seconds)) + LEAD_M, rng)
    return Street(path, _waves(rng), LANE_M + _PARKING_M, walk, ego, vehicles)


def _path(length: float, rng: np.random.Generator) -> np.ndarray:
    """Straights and bends; bends go left and right by turns, so that it never meets itself.

    Bends have radii of 18 to 45 m and turn by 20 to 90 degrees.
    """
    curvature = [np.zeros(int((2 * LEAD_M + rng.uniform(0.0, 20.0)) / _STEP_M))]
    sign = rng.choice((-1.0, 1.0))
    while sum(map(len, curvature)) * _STEP_M < length + 2 * LEAD_M:
        radius, turn = rng.uniform(18.0, 45.0), np.radians(rng.uniform(20.0, 90.0))
        curvature.append(np.full(int(radius * turn / _STEP_M), sign / radius))
        curvature.append(np.zeros(int(rng.uniform(20.0, 70.0) / _STEP_M)))
        sign = -sign
    window = int(_SMOOTH_M / _STEP_M)
    bent = np.convolve(np.concatenate(curvature), np.full(window, 1 / window), "same")
    yaw = rng.uniform(0, 2 * np.pi) + np.cumsum(bent) * _STEP_M
    x, y = np.cumsum(np.cos(yaw)) * _STEP_M, np.cumsum(np.sin(yaw)) * _STEP_M
    s = np.arange(len(yaw)) * _STEP_M - 2 * LEAD_M
    start = int(np.searchsorted(s, 0.0))
    return np.column_stack((s, x - x[start], y - y[start], yaw))


def _waves(rng: np.random.Generator) -> np.ndarray:
    """Six waves of 30 to 250 m, each of a slope of 0.3 to 1.2 percent."""
    length, turn = rng.uniform(30.0, 250.0, 6), rng.uniform(0, 2 * np.pi, 6)
    wave = 2 * np.pi / length
    slope = rng.uniform(0.003, 0.012, 6)
    phase = rng.uniform(0, 2 * np.pi, 6)
    return np.stack((wave * np.cos(turn), wave * np.sin(turn), phase, slope / wave), -1)
