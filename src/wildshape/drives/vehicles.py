# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which of the completed objects are vehicles: by label-free cost, by size, and none twice."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import VehicleConfig
from wildshape.drives.sightings import Sightings
from wildshape.geometry.footprint import footprint_overlap


@dataclass(frozen=True)
class Completed:
    """A completed object in the drive's level world frame (z vertical).

    Attributes:
        seen: in which frames, all of them.
        frames: those of its completed scans.
        boxes: `(k, 4)` centre x, y, z and yaw in each of them.
        size: `(3,)` length, width, height, metres.
        cost_m: mean label-free cost.
        confidence: of the completions, 0 to 1.
    """

    seen: Sightings
    frames: tuple[int, ...]
    boxes: Float[np.ndarray, "k 4"]
    size: tuple[float, float, float]
    cost_m: float
    confidence: float

    @property
    def fullest(self) -> int:
        """Points of its fullest scan."""
        return max(self.seen.points)


@dataclass(frozen=True)
class Judged:
    """What was said of an object.

    Attributes:
        name: of it.
        reasons: why it is no vehicle, or not this one; empty for vehicles.
    """

    name: str
    reasons: tuple[str, ...]


def judge(objects: list[Completed], config: VehicleConfig) -> list[Judged]:
    """Every object, in the order given.

    Of two that share a place at the same time the one with the better cost stays.
    """
    own = {one.seen.name: _reasons(one, config) for one in objects}
    kept: list[Completed] = []
    for one in sorted(objects, key=lambda one: one.cost_m):
        name = one.seen.name
        if own[name]:
            continue
        rival = next((other for other in kept if _same_place(one, other, config)), None)
        if rival is None:
            kept.append(one)
        else:
            own[name] = (f"same_place_as_{rival.seen.name}",)
    return [Judged(one.seen.name, own[one.seen.name]) for one in objects]


def _reasons(one: Completed, config: VehicleConfig) -> tuple[str, ...]:
    limits = zip(("length", "width", "height"), one.size, _sizes(config))
    wrong = [name for name, value, (low, high) in limits if not low <= value <= high]
    costly = ["cost"] if one.cost_m > config.worst_cost_m else []
    few = ["few_points"] if one.fullest < config.fewest_points else []
    return (*costly, *wrong, *few)


def _sizes(config: VehicleConfig) -> tuple[tuple[float, float], ...]:
    return config.length_m, config.width_m, config.height_m


def _same_place(one: Completed, other: Completed, config: VehicleConfig) -> bool:
    """Whether the two share a place at about one time: twice the same vehicle."""
    for frame, box in zip(one.frames, one.boxes):
        nearest = int(np.abs(np.array(other.frames) - frame).argmin())
        if abs(other.frames[nearest] - frame) > config.same_time_frames:
            continue
        beside = other.boxes[nearest]
        near = np.hypot(*(box[:2] - beside[:2])) < (one.size[0] + other.size[0]) / 2
        if near and footprint_overlap(box, one.size, beside, other.size) > config.overlap:
            return True
    return False
