# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which of the completed objects are vehicles, by the network's own word; and none twice."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wildshape.drives.completing.boxes import moves, velocity_of
from wildshape.drives.completing.level_frame import Completed, as_box_sees
from wildshape.drives.completing.merging import Places
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import BoxConfig, VehicleConfig
from wildshape.drives.tracking.clusters import extents
from wildshape.drives.tracking.sightings import Sightings
from wildshape.io.atomic import write_json
from wildshape.records import Points

_FEWEST_OF_A_WAY = 3  # completed scans


@dataclass(frozen=True)
class Judged:
    """What was said of an object.

    Attributes:
        confidence: that it is a vehicle, 0 to 1.
        reasons: why it is no vehicle, or not this one; empty for vehicles.
    """

    name: str
    confidence: float
    reasons: tuple[str, ...]


def judge(objects: list[Completed], places: Places, config: VehicleConfig) -> list[Judged]:
    """Every object, in the order given; `places`: where they are.

    Of those that share a place at the same time the surest stays; several tracks put together come
    before their parts if they are sure enough.
    """
    sure = {one.seen.name: vehicle_confidence(one, config) for one in objects}
    own = {one.seen.name: _reasons(one, sure[one.seen.name], config) for one in objects}
    kept: list[Completed] = []

    def order(one: Completed) -> tuple[bool, float]:
        confidence = sure[one.seen.name]
        return bool(one.seen.parts) and confidence > config.sure_of_parts, confidence

    for one in sorted(objects, key=order, reverse=True):
        name = one.seen.name
        if own[name]:
            continue
        rival = next((other for other in kept if places.share(one, other)), None)
        if rival is None:
            kept.append(one)
        else:
            own[name] = (f"same_place_as_{rival.seen.name}",)
    names = (one.seen.name for one in objects)
    return [Judged(name, sure[name], own[name]) for name in names]


def surer_if_driving(
    one: Completed, cuts: Path, turns: Turns, boxes: BoxConfig, config: VehicleConfig
) -> Completed:
    """What gets far and looks the way it goes is a vehicle, whatever is said of its shape."""
    kind = one.p_kind
    if kind is None or kind < config.least_far or len(one.frames) < _FEWEST_OF_A_WAY:
        return one
    way = _driven(one, turns, boxes, config)
    if kind < config.least_driving:
        drives = way >= config.far_m and _seen_large(one, cuts, turns, config)
    else:
        drives = way >= config.driving_m
    if not drives:
        return one
    surer = max(kind, config.driving_kind)
    stated = max(one.confidence * surer / kind, config.driving_confidence)
    return replace(one, p_kind=surer, confidence=min(stated, 1.0))


def _driven(one: Completed, turns: Turns, boxes: BoxConfig, config: VehicleConfig) -> float:
    """How far it gets, metres, if it looks the way it goes; else 0."""
    at = np.take(turns.ticks, one.frames) + one.phases
    if not moves(at, one.boxes, boxes):
        return 0.0
    velocity = velocity_of(at, one.boxes[:, :2])
    course = np.arctan2(velocity[1], velocity[0])
    off = np.abs(np.arcsin(np.sin(one.boxes[:, 3] - course)))  # front or rear ahead
    looks_ahead = np.median(off) <= np.deg2rad(config.driving_deg)
    return float(np.hypot(*velocity) * np.ptp(at)) if looks_ahead else 0.0


def _seen_large(one: Completed, cuts: Path, turns: Turns, config: VehicleConfig) -> bool:
    """Whether its points, in the middle one of its scans, are as long or as wide as a vehicle."""
    rows = [one.seen.frames.index(frame) for frame in one.frames]
    sides = []
    for frame, cloud, box in zip(one.frames, one.seen.part(rows).clouds(cuts), one.boxes):
        seen = as_box_sees(turns.T_level_sensor[frame].apply_numpy(cloud), box)
        sides.append(np.ptp(seen[:, :2], axis=0))
    return bool((np.median(sides, axis=0) >= config.far_sides_m).any())


def likely(objects: list[Completed], least: float, config: VehicleConfig) -> list[Completed]:
    """Those that are vehicles with at least this confidence."""
    return [one for one in objects if vehicle_confidence(one, config) >= least]


def vehicle_confidence(one: Completed, config: VehicleConfig) -> float:
    """How sure it is that an object is a vehicle: `p_kind`, where the weights state it.

    Of other weights what speaks for one is added up, in nats: its cost, its size (Gaussian around
    the nearest kind of vehicle), whether several tracks agree on its shape, how often it was seen
    (at most a nat), and what the network says of its completions (at most half).
    """
    if one.p_kind is not None:
        return one.p_kind
    shape = shape_nats(one.cost_m, one.size, config)
    seen = 0.5 * math.log(len(one.seen.frames) / config.usual_scans)
    said = 0.25 * math.log(max(one.confidence, 1e-6) / config.usual_confidence)
    together = config.merged_nats if one.seen.parts else 0.0
    nats = shape + together + min(max(seen, -1.0), 1.0) + min(max(said, -0.5), 0.5)
    return 1.0 / (1.0 + math.exp(-min(max(nats, -20.0), 20.0)))


def stated(one: Completed, sure: Mapping[str, float]) -> float:
    """What its boxes state: that kind, heading and size are right, where the weights know.

    Args:
        one: a vehicle.
        sure: by name, how sure it is that each is one; of other weights that is stated.
    """
    return sure[one.seen.name] if one.p_kind is None else one.confidence


def shape_nats(cost_m: float, size: tuple[float, float, float], config: VehicleConfig) -> float:
    """What a completed shape alone says for a vehicle, log-odds: its cost and its size."""
    cost = (config.even_cost_m - cost_m) / config.cost_scale_m
    apart = (np.array(size) / np.array(config.kinds) - 1.0) / config.spread
    return cost + 1.0 - 0.5 * float((apart**2).sum(1).min())


def vehicle_sized(clouds: Sequence[Points], config: VehicleConfig) -> bool:
    """Whether the points, level frames, are as large as a vehicle, in the middle one of scans."""
    sides = np.median([(*extents(cloud), np.ptp(cloud[:, 2])) for cloud in clouds], axis=0)
    return all(low <= side <= high for side, (low, high) in zip(sides, _sizes(config)))


def refused(said: list[Judged], why: Mapping[str, str]) -> list[Judged]:
    """What was said, and that some are no vehicles after all; `why`: by their names."""
    return [replace(one, reasons=(why[one.name],)) if one.name in why else one for one in said]


def write_judged(path: Path, objects: list[Sightings], said: list[Judged]) -> None:
    """Why each object of a drive is a vehicle or not."""
    judged = {one.name: (one.confidence, list(one.reasons)) for one in said}
    rows = []
    for seen in objects:
        confidence, why = judged.get(seen.name, (0.0, ["first_looks"]))
        row = {"track": seen.name, "vehicle": not why, "confidence": confidence}
        rows.append({**row, "reasons": why})
    write_json(path, rows)


def _reasons(one: Completed, confidence: float, config: VehicleConfig) -> tuple[str, ...]:
    length, width, (lowest, highest) = _sizes(config)
    if confidence >= config.tall_kind:
        highest = config.tall_m
    limits = zip(("length", "width", "height"), one.size, (length, width, (lowest, highest)))
    wrong = [name for name, value, (low, high) in limits if not low <= value <= high]
    least = config.least_confidence if one.p_kind is None else config.least_kind
    unlikely = ["unlikely"] if confidence < least else []
    few = ["few_points"] if one.fullest < config.fewest_points else []
    return (*unlikely, *wrong, *few)


def _sizes(config: VehicleConfig) -> tuple[tuple[float, float], ...]:
    return config.length_m, config.width_m, config.height_m
