# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One turn of a spinning LiDAR over one object: the rays, and what comes back."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wildshape.geometry.projection.full_scan import FullScan, sight_lines
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.simulate.raycast import Hits, Scene
from wildshape.simulate.sensor import SpinningLidar
from wildshape.simulate.shapes.solid import Solid


@dataclass(frozen=True)
class Returns:
    """How pulses are lost and blurred.

    Attributes:
        noise_m: sigma of the range noise, metres.
        dropout: share of pulses lost at random.
        glass: share of pulses on glass that do come back.
        ground: whether ground returns near the object's box are left in.
        rim_m: how near, metres.
        grazing: a pulse that meets a surface at a smaller cosine comes back less often, in
            proportion.
        through: share of the pulses lost on glass that come back from what is behind it.
    """

    noise_m: float
    dropout: float
    glass: float
    ground: bool
    rim_m: float = 0.3
    grazing: float = 0.12
    through: float = 0.0


class Turn(NamedTuple):
    """What one turn over an object gives.

    Attributes:
        points: `(n, 3)` float32, metres, sensor frame.
        on_target: how many of them lie on the object; the others lie on the ground.
        phase_deg: azimuth of the turn's first firing.
        lost: `(k, 3)` float32 unit directions, sensor frame, of pulses that met the object and did
            not come back.
    """

    points: np.ndarray
    on_target: int
    phase_deg: float
    lost: np.ndarray


def window(T_object_sensor: np.ndarray, half: np.ndarray) -> tuple[float, ...]:
    """Azimuth and elevation range of an object's box in the sensor's image, degrees.

    Args:
        T_object_sensor: `(4, 4)`.
        half: `(3,)` half lengths of the box around the object's origin, metres.

    Returns:
        Azimuth from, to (to >= from, no seam between), elevation from, to.
    """
    edges = (_EDGES * half - T_object_sensor[:3, 3]) @ T_object_sensor[:3, :3]
    middle = -T_object_sensor[:3, 3] @ T_object_sensor[:3, :3]
    toward = np.arctan2(middle[1], middle[0])
    azimuth = np.arctan2(edges[:, 1], edges[:, 0]) - toward
    azimuth = np.degrees((azimuth + np.pi) % (2 * np.pi) - np.pi)
    elevation = np.degrees(np.arctan2(edges[:, 2], np.hypot(edges[:, 0], edges[:, 1])))
    away = np.degrees(toward)
    return (
        away + azimuth.min(), away + azimuth.max(),
        float(elevation.min()) - 0.05, float(elevation.max()) + 0.05,
    )  # fmt: skip


def rays(
    sensor: SpinningLidar, bounds: tuple[float, ...], phase_deg: float, R: np.ndarray
) -> np.ndarray:
    """The sensor's own pulses within a window, ring by ring from the top.

    Args:
        sensor: its beam table and azimuth step.
        bounds: as from `window`, degrees.
        phase_deg: azimuth of the turn's first firing, degrees.
        R: `(3, 3)` rotation from the sensor frame to that of the answer.

    Returns:
        `(n, 3)` float32 unit directions, turned by R.
    """
    table = np.asarray(sensor.elevation_deg)
    ring = np.flatnonzero((table >= bounds[2]) & (table <= bounds[3]))
    step = sensor.azimuth_step_deg
    first = np.ceil((bounds[0] - phase_deg) / step) - 1
    columns = np.arange(int((bounds[1] - bounds[0]) / step) + 3)
    column = np.radians(phase_deg + step * (first + columns))
    own = np.radians(sensor.ring_phase_deg[ring])
    theta = np.radians(table[ring])
    # R (cos t cos p, cos t sin p, sin t) with p = own + column, by the addition theorem, so
    # that sines are taken per ring and per column and not per pulse.
    cos_own, sin_own = np.cos(theta) * np.cos(own), np.cos(theta) * np.sin(own)
    cos, sin = np.cos(column).astype(np.float32), np.sin(column).astype(np.float32)
    directions = np.empty((len(ring), len(column), 3), np.float32)
    for k, (rx, ry, rz) in enumerate(R):
        of_cos = (rx * cos_own + ry * sin_own).astype(np.float32)[:, None]
        of_sin = (ry * cos_own - rx * sin_own).astype(np.float32)[:, None]
        up = (rz * np.sin(theta)).astype(np.float32)[:, None]
        directions[..., k] = of_cos * cos + of_sin * sin + up
    return directions.reshape(-1, 3)


def scan(
    scene: Scene,
    target: Solid,
    sensor: SpinningLidar,
    T_object_sensor: np.ndarray,
    returns: Returns,
    rng: np.random.Generator,
) -> Turn:
    """One scan of the object.

    Args:
        scene: the target as solid 0, anything after it only blocks the view.
        target: the object, its box centre at the origin of its frame.
        sensor: what scans.
        T_object_sensor: `(4, 4)` where it stands.
        returns: how pulses are lost.
        rng: the only source of chance.
    """
    half = target.bounds[1]
    grown = half + ((returns.rim_m, returns.rim_m, 0.0) if returns.ground else 0.0)
    phase = float(rng.uniform(0, sensor.azimuth_step_deg))
    toward = rays(sensor, window(T_object_sensor, grown), phase, T_object_sensor[:3, :3])
    origin = T_object_sensor[:3, 3]
    hits = scene.cast(np.broadcast_to(origin, toward.shape), toward)
    kept = _returned(hits, target, sensor, returns, rng)
    distance = hits.distance.astype(np.float64)
    if returns.through > 0:
        inside = _behind_glass(scene, target, origin, toward, hits, kept, returns, rng)
        kept, distance = kept | (inside > 0), np.where(inside > 0, inside, distance)
    missed = toward.take(np.flatnonzero((hits.solid == 0) & ~kept), axis=0)
    on_target = int(kept.sum())
    if returns.ground:
        below = _ground(hits, toward, origin, half, returns.rim_m)
        lost = rng.random(len(below)) < returns.dropout
        distance = np.where(below > 0, below, distance)
        kept = np.where(below > 0, ~lost, kept)
    back = np.flatnonzero(kept)
    reach = distance[back] + returns.noise_m * rng.standard_normal(len(back))
    on_ray = toward.take(back, axis=0) * reach[:, None]
    R = T_object_sensor[:3, :3]
    return Turn(_turned(on_ray, R), on_target, phase, _turned(missed, R))


def _turned(vectors: np.ndarray, R_object_sensor: np.ndarray) -> np.ndarray:
    """From the object's axes to the sensor's, float32."""
    return np.einsum("ji,nj->ni", R_object_sensor, vectors).astype(np.float32)


@dataclass(frozen=True)
class Backdrop:
    """A wall along the road, beyond the object as the sensor sees it.

    Attributes:
        offset_m: of the wall from the object's middle.
        height_m: above the ground.
    """

    offset_m: float
    height_m: float

    def distance(self, origin: np.ndarray, toward: np.ndarray, ground_z: float) -> np.ndarray:
        """How far rays `(n, 3)` go until they meet it, metres; infinite where they do not.

        Object frame, x along the road.
        """
        y = -np.copysign(self.offset_m, origin[1])
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (y - origin[1]) / toward[:, 1]
            met = (reach > 0) & (origin[2] + reach * toward[:, 2] < ground_z + self.height_m)
        return np.where(met, reach, np.inf)


def passing_rays(
    scene: Scene,
    target: Solid,
    sensor: SpinningLidar,
    T_object_sensor: np.ndarray,
    returns: Returns,
    turn: Turn,
    most: int,
    rng: np.random.Generator,
    backdrop: Backdrop | None = None,
) -> SightLines | None:
    """The rays of the same turn that passed the object by, or did not come back from it.

    The ground goes on for ever; behind the object there is nothing else than what blocks the view
    of it, and the backdrop. `turn` is what `scan` made of the same; at most `most` rays come back.
    """
    half = target.bounds[1]
    R, origin = T_object_sensor[:3, :3], T_object_sensor[:3, 3]
    toward = rays(sensor, window(T_object_sensor, half + _AROUND_M), turn.phase_deg, R)
    hits = scene.cast(np.broadcast_to(origin, toward.shape), toward)
    with np.errstate(divide="ignore"):
        ground = np.where(toward[:, 2] < 0, (-half[2] - origin[2]) / toward[:, 2], np.inf)
    wall = np.inf if backdrop is None else backdrop.distance(origin, toward, -half[2])
    other = np.minimum(ground, wall)
    reach = np.minimum(hits.distance, other)
    by = (hits.solid != 0) | (other < hits.distance)
    if returns.ground:  # what lies beside the object is in the scan
        by &= _ground(hits, toward, origin, half, returns.rim_m) == 0
    back = by & (reach < sensor.max_range_m) & (rng.random(len(reach)) >= returns.dropout)
    noisy = reach[back] + returns.noise_m * rng.standard_normal(int(back.sum()))
    ends = _turned(toward[back] * noisy[:, None], R)
    lost = np.concatenate((turn.lost, _turned(toward[by & ~back], R)))
    full = FullScan(np.concatenate((turn.points, ends)), lost=lost)
    return sight_lines(full, np.arange(len(turn.points)), most)


def _returned(
    hits: Hits, target: Solid, sensor: SpinningLidar, returns: Returns, rng: np.random.Generator
) -> np.ndarray:
    """`(n,)` bool: pulses on the target that come back strong enough to be told."""
    hit = np.flatnonzero((hits.solid == 0) & (hits.distance < sensor.max_range_m))
    chance = (1.0 - returns.dropout) * np.minimum(hits.cosine[hit] / returns.grazing, 1.0)
    chance[target.glass[hits.face[hit]]] *= returns.glass
    kept = np.zeros(len(hits.face), bool)
    kept[hit] = rng.random(len(hit)) < chance
    return kept


def _behind_glass(
    scene: Scene,
    target: Solid,
    origin: np.ndarray,
    toward: np.ndarray,
    hits: Hits,
    kept: np.ndarray,
    returns: Returns,
    rng: np.random.Generator,
) -> np.ndarray:
    """`(n,)` range of what a pulse meets that passed a pane of the target; else 0."""
    reach = np.zeros(len(kept))
    lost = np.flatnonzero((hits.solid == 0) & ~kept)
    panes = lost[target.glass[hits.face[lost]]]
    passed = panes[rng.random(len(panes)) < returns.through]
    starts = origin + toward[passed] * (hits.distance[passed, None] + _PANE_M)
    behind = scene.cast(starts, toward[passed])
    met = np.flatnonzero(behind.solid == 0)
    met = met[~target.glass[behind.face[met]]]
    reach[passed[met]] = hits.distance[passed[met]] + _PANE_M + behind.distance[met]
    return reach


def _ground(
    hits: Hits, toward: np.ndarray, origin: np.ndarray, half: np.ndarray, rim_m: float
) -> np.ndarray:
    """`(n,)` range of the ground where a pulse meets it first, near the object; else 0."""
    down = np.minimum(toward[:, 2], -1e-9)
    reach = (-half[2] - origin[2]) / down
    at = origin[:2] + reach[:, None] * toward[:, :2]
    near = (np.abs(at) <= half[:2] + rim_m).all(1)
    return np.where(near & (reach < hits.distance), reach, 0.0)


_AROUND_M = 2.0  # wider than what is kept
_PANE_M = 0.02


def _box_edges() -> np.ndarray:
    """`(108, 3)` points along the edges of the cube from -1 to 1."""
    t = np.linspace(-1, 1, 9)
    corners = np.array([(a, b) for a in (-1, 1) for b in (-1, 1)], float)
    edges = [
        np.insert(np.repeat(corners, len(t), 0), axis, np.tile(t, 4), axis=1) for axis in range(3)
    ]
    return np.concatenate(edges)


_EDGES = _box_edges()
