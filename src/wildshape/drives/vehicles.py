# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which of the completed objects are vehicles: by cost, size and how long seen; and none twice."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from wildshape.drives.config import VehicleConfig
from wildshape.drives.sightings import Sightings, merged
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
        confidence: that it is a vehicle, 0 to 1.
        reasons: why it is no vehicle, or not this one; empty for vehicles.
    """

    name: str
    confidence: float
    reasons: tuple[str, ...]


def judge(objects: list[Completed], config: VehicleConfig) -> list[Judged]:
    """Every object, in the order given.

    Of those that share a place at the same time the one of most confidence stays.
    """
    sure = {one.seen.name: vehicle_confidence(one, config) for one in objects}
    own = {one.seen.name: _reasons(one, sure[one.seen.name], config) for one in objects}
    kept: list[Completed] = []
    for one in sorted(objects, key=lambda one: -sure[one.seen.name]):
        name = one.seen.name
        if own[name]:
            continue
        rival = next((other for other in kept if same_place(one, other, config)), None)
        if rival is None:
            kept.append(one)
        else:
            own[name] = (f"same_place_as_{rival.seen.name}",)
    names = (one.seen.name for one in objects)
    return [Judged(name, sure[name], own[name]) for name in names]


def vehicle_confidence(one: Completed, config: VehicleConfig) -> float:
    """How sure it is that an object is a vehicle: what speaks for it, in nats, added up.

    Its cost, its size (Gaussian around the nearest kind of vehicle), whether several tracks agree
    on its shape, how often it was seen (at most a nat), and what the network says of its
    completions (at most half).
    """
    shape = shape_nats(one.cost_m, one.size, config)
    seen = 0.5 * math.log(len(one.seen.frames) / config.usual_scans)
    said = 0.25 * math.log(max(one.confidence, 1e-6) / config.usual_confidence)
    together = config.merged_nats if one.seen.parts > 1 else 0.0
    nats = shape + together + min(max(seen, -1.0), 1.0) + min(max(said, -0.5), 0.5)
    return 1.0 / (1.0 + math.exp(-min(max(nats, -20.0), 20.0)))


def shape_nats(cost_m: float, size: tuple[float, float, float], config: VehicleConfig) -> float:
    """What a completed shape alone says for a vehicle, log-odds: its label-free cost and its size.

    Args:
        cost_m: metres.
        size: length, width, height, metres.
        config: see there.
    """
    cost = (config.even_cost_m - cost_m) / config.cost_scale_m
    apart = (np.array(size) / np.array(config.kinds) - 1.0) / config.spread
    return cost + 1.0 - 0.5 * float((apart**2).sum(1).min())


def fragments(objects: list[Completed], config: VehicleConfig) -> list[Sightings]:
    """Those of several tracks, or pieces of one scan, that are one object by their shapes.

    Complete shapes that share a place at about the same time are one thing, whatever gap was
    between the clusters that they came from.
    """
    from scipy.sparse.csgraph import connected_components

    shared = [[same_place(one, other, config) for other in objects] for one in objects]
    if not objects:
        return []
    count, group = connected_components(np.array(shared), directed=False)
    groups = [[objects[i].seen for i in np.flatnonzero(group == g)] for g in range(count)]
    return [merged(parts) for parts in groups if len(parts) > 1]


def _reasons(one: Completed, confidence: float, config: VehicleConfig) -> tuple[str, ...]:
    limits = zip(("length", "width", "height"), one.size, _sizes(config))
    wrong = [name for name, value, (low, high) in limits if not low <= value <= high]
    unlikely = ["unlikely"] if confidence < config.least_confidence else []
    few = ["few_points"] if one.fullest < config.fewest_points else []
    return (*unlikely, *wrong, *few)


def _sizes(config: VehicleConfig) -> tuple[tuple[float, float], ...]:
    return config.length_m, config.width_m, config.height_m


def same_place(one: Completed, other: Completed, config: VehicleConfig) -> bool:
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
