# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What stands between sensor and object: poles, boxes, other parked cars."""

import numpy as np

from wildshape.simulate.shapes.solid import Solid, box, cylinder
from wildshape.simulate.shapes.vehicle import random_vehicle

_TRIES = 8
_ROW = 0.35  # of the vehicles stand in a row with the object


def occluders(target: Solid, sensors: np.ndarray, rng: np.random.Generator) -> list[Solid]:
    """One to three things on the same ground as the object, in its frame.

    Args:
        target: the object, box centre at the origin.
        sensors: `(v, 3)` where the sensor will be, object frame, metres.
        rng: the only source of chance.

    Returns:
        Solids clear of the object and of the sensor's way; possibly none where there is no room.
    """
    placed = []
    for _ in range(int(rng.integers(1, 4))):
        for _ in range(_TRIES):
            thing = _thing(rng)
            in_row = bool(thing.kind) and rng.random() < _ROW
            at = _beside(target, thing, rng) if in_row else _between(sensors, rng)
            moved = _stand(thing, target, at, rng)
            if _clear(moved, target, sensors):
                placed.append(moved)
                break
    return placed


def _thing(rng: np.random.Generator) -> Solid:
    """A pole, a box (bin, bush, person) or a vehicle, standing on z = 0."""
    choice = rng.random()
    if choice < 0.4:
        radius, top = rng.uniform(0.04, 0.2), rng.uniform(2.0, 5.0)
        return cylinder(np.zeros(3), np.array((0.0, 0.0, top)), (radius, radius), 8)
    if choice < 0.75:
        x, y, top = rng.uniform(0.2, 0.6), rng.uniform(0.2, 0.6), rng.uniform(0.6, 1.8)
        return box((-x, -y, 0.0), (x, y, top))
    return random_vehicle(rng)


def _beside(target: Solid, thing: Solid, rng: np.random.Generator) -> np.ndarray:
    """The next place of a parking row: before, behind or beside, `(2,)` metres."""
    axis = 0 if rng.random() < 0.7 else 1
    gap = rng.uniform(0.5, 1.8)
    at = rng.normal(0.0, 0.15, 2)
    reach = target.bounds[1, axis] + thing.bounds[1, axis] + gap
    at[axis] = rng.choice((-1.0, 1.0)) * reach
    return at


def _between(sensors: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """On the line of sight of some scan, `(2,)` metres."""
    sensor = sensors[rng.integers(len(sensors)), :2]
    return sensor * rng.uniform(0.25, 0.75) + rng.normal(0.0, 0.8, 2)


def _stand(thing: Solid, target: Solid, at: np.ndarray, rng: np.random.Generator) -> Solid:
    half_turns = rng.integers(0, 2) * np.pi if thing.kind else rng.uniform(0, 2 * np.pi)
    yaw = half_turns + rng.normal(0.0, 0.05)
    return thing.moved(np.array((at[0], at[1], target.bounds[0, 2])), yaw=yaw)


def _clear(thing: Solid, target: Solid, sensors: np.ndarray) -> bool:
    """Boxes 0.2 m apart, and 1 m from every place of the sensor."""
    low, high = thing.bounds
    theirs = target.bounds
    apart = bool(np.any(low[:2] > theirs[1, :2] + 0.2) or np.any(high[:2] < theirs[0, :2] - 0.2))
    outside = np.maximum(low[:2] - sensors[:, :2], sensors[:, :2] - high[:2]).max(1)
    return apart and bool(outside.min() > 1.0)
