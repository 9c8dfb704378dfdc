# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One turn of a spinning LiDAR amid a street, each azimuth at its own time.

Every pulse ends at the nearest of all surfaces. What stands still is one scene for all pulses. A
thing that moves is met in its own frame, where the pulses of each azimuth start from where the
sensor is then: so its shape needs no rebuilding, however it moves during the turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wildshape.simulate.raycast import Hits, Scene
from wildshape.simulate.sensor import SpinningLidar
from wildshape.simulate.shapes.solid import Solid

NOBODY = -1
_GRAZING, _GRAZING_GROUND = 0.12, 0.03
_GROUND_ALBEDO, _THING_ALBEDO = 0.2, 0.35


@dataclass(frozen=True)
class Surfaces:
    """Solids in one scene, and what they are.

    Attributes:
        owner: `(k,)` the track number of each solid's actor, or `NOBODY`.
        ground: `(k,)` whether it is ground, which is told at more grazing angles.
        glass: of all faces, solid after solid.
        first_face: `(k,)` where a solid's faces begin in `glass`.
    """

    scene: Scene
    owner: np.ndarray
    ground: np.ndarray
    glass: np.ndarray
    first_face: np.ndarray


@dataclass(frozen=True)
class Mover:
    """A thing that moves during a turn.

    Attributes:
        surfaces: its own, in its frame.
        reach: of its farthest point from its origin, metres.
        T_world_object: `(c, 4, 4)` at each column's time.
    """

    surfaces: Surfaces
    reach: float
    T_world_object: np.ndarray


@dataclass(frozen=True)
class Pulses:
    """One turn's pulses, ring after ring from the top.

    Attributes:
        directions: `(r, c, 3)` float32 unit vectors in the sensor frame.
        azimuth: `(c,)` of the columns, radians.
        times: `(c,)` of the columns, seconds from the turn's middle.
    """

    directions: np.ndarray
    azimuth: np.ndarray
    times: np.ndarray


@dataclass
class Echoes:
    """What each pulse met first, `(r, c)` each; see `Surfaces` and `Hits`."""

    distance: np.ndarray
    cosine: np.ndarray
    owner: np.ndarray
    ground: np.ndarray
    glass: np.ndarray


def surfaces(solids: Sequence[Solid], owner: Sequence[int], ground: int = 0) -> Surfaces:
    """Build a scene; its first `ground` solids are ground."""
    faces = [len(one.faces) for one in solids]
    return Surfaces(
        Scene(list(solids)),
        np.asarray(owner),
        np.arange(len(solids)) < ground,
        np.concatenate([one.glass for one in solids]),
        np.cumsum([0, *faces[:-1]]),
    )


def pulses(sensor: SpinningLidar, period_s: float) -> Pulses:
    """A turn from behind over the right side, the front and the left."""
    step = sensor.azimuth_step_deg
    columns = np.arange(int(360 / step))
    azimuth = np.radians(-180 + step * columns)
    elevation = np.radians(sensor.elevation_deg)[:, None]
    turn = azimuth + np.radians(sensor.ring_phase_deg)[:, None]
    flat = np.cos(elevation)
    up = np.broadcast_to(np.sin(elevation), turn.shape)
    directions = np.stack((flat * np.cos(turn), flat * np.sin(turn), up), -1)
    times = (columns / len(columns) - 0.5) * period_s
    return Pulses(directions.astype(np.float32), azimuth, times)


def cast_turn(
    still: Surfaces, movers: Sequence[Mover], turn: Pulses, T_world_sensor: np.ndarray
) -> Echoes:
    """The nearest surface of each pulse.

    `still` is in the world frame; `T_world_sensor`: `(c, 4, 4)` at each column's time.
    """
    echoes = _cast(still, turn.directions, T_world_sensor)
    for mover in movers:
        columns = _facing(mover, turn, T_world_sensor)
        if len(columns) == 0:
            continue
        T_object_world = np.linalg.inv(mover.T_world_object[columns])
        met = _cast(
            mover.surfaces, turn.directions[:, columns], T_object_world @ T_world_sensor[columns]
        )
        ring, place = np.nonzero(met.distance < echoes.distance[:, columns])
        for name in Echoes.__dataclass_fields__:
            getattr(echoes, name)[ring, columns[place]] = getattr(met, name)[ring, place]
    return echoes


def _facing(mover: Mover, turn: Pulses, T_world_sensor: np.ndarray) -> np.ndarray:
    """The columns that may meet a mover."""
    away = mover.T_world_object[:, :3, 3] - T_world_sensor[:, :3, 3]
    x, y, _ = np.einsum("cji,cj->ic", T_world_sensor[:, :3, :3], away)
    distance = np.hypot(x, y)
    half = np.arcsin(np.minimum(mover.reach / np.maximum(distance, 1e-9), 1.0))
    off = np.angle(np.exp(1j * (np.arctan2(y, x) - turn.azimuth)))
    margin = 2 * abs(turn.azimuth[1] - turn.azimuth[0])
    return np.flatnonzero((np.abs(off) <= half + margin) | (distance <= mover.reach))


def _cast(scene: Surfaces, directions: np.ndarray, T_scene_sensor: np.ndarray) -> Echoes:
    R = T_scene_sensor[:, :3, :3].astype(np.float32)
    x, y, z = np.moveaxis(directions, -1, 0)
    toward = np.stack([R[:, k, 0] * x + R[:, k, 1] * y + R[:, k, 2] * z for k in range(3)], -1)
    origins = np.broadcast_to(T_scene_sensor[:, :3, 3], toward.shape)
    hits = scene.scene.cast(origins.reshape(-1, 3), toward.reshape(-1, 3))
    return _named(scene, hits, directions.shape[:2])


def _named(scene: Surfaces, hits: Hits, shape: tuple[int, ...]) -> Echoes:
    which = np.maximum(hits.solid, 0)
    face = scene.first_face[which] + np.maximum(hits.face, 0)
    met = hits.solid >= 0
    parts = (
        hits.distance,
        hits.cosine,
        np.where(met, scene.owner[which], NOBODY),
        scene.ground[which] & met,
        scene.glass[face] & met,
    )
    return Echoes(*(part.reshape(shape) for part in parts))


def returned(
    echoes: Echoes,
    sensor: SpinningLidar,
    dropout: float,
    glass: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """`(r, c)` bool: pulses that come back strong enough to be told.

    `dropout`: share of pulses lost at random; `glass`: of those on glass that do come back.
    """
    grazing = np.where(echoes.ground, _GRAZING_GROUND, _GRAZING)
    chance = (1.0 - dropout) * np.minimum(echoes.cosine / grazing, 1.0)
    chance = np.where(echoes.glass, glass * chance, chance)
    kept = rng.random(chance.shape) < chance
    return kept & (echoes.distance < sensor.max_range_m)


def intensity(echoes: Echoes) -> np.ndarray:
    """`(r, c)` float32, 0 to 1: paint of its own for each actor, less at grazing angles."""
    paint = 0.1 + 0.7 * ((echoes.owner * 0.6180339887498949) % 1.0)
    plain = np.where(echoes.ground, _GROUND_ALBEDO, _THING_ALBEDO)
    albedo = np.where(echoes.owner == NOBODY, plain, paint)
    return (albedo * np.sqrt(echoes.cosine)).astype(np.float32)
