# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive made ready to be drawn: frames and points thinned, each point with the vehicle it is on.

The drawing frame is the level world (`drives/completing/level_frame.py`): z up, metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.source import Drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle
from wildshape.drives.writing.playback.moments import PALETTE
from wildshape.geometry.box import box_axes
from wildshape.geometry.footprint import upright_places
from wildshape.geometry.sampling import thin
from wildshape.ops.connected import first_of_cells
from wildshape.parallel.team import ALONE, Team
from wildshape.records import Box, Points
from wildshape.report.page.html import quantise
from wildshape.report.results import chances_in

_AROUND_M, _FOOT_M = 0.15, 0.15  # a box that is a little small; the ground under it
NOBODY = -1
_NO_POINTS = np.empty((0, 3), np.float32)


@dataclass(frozen=True)
class SceneConfig:
    """How much of a drive is drawn: a page of it stays below 25 MB.

    Attributes:
        frames: at most so many, evenly spread, and one for each vehicle that is in none of them.
        points: of all frames drawn.
        points_a_scan: at most.
        points_a_vehicle: at most, of those in a scan.
        vehicle_points: on all vehicles in all frames drawn.
        points_a_shape: at most, of a complete one.
        shape_points: of all complete ones together.
        range_m: farther points are left out.
        cell_m: of the rest one point in each cell of this size is drawn.
    """

    frames: int = 120
    points: int = 1_200_000
    points_a_scan: int = 14_000
    points_a_vehicle: int = 400
    vehicle_points: int = 900_000
    points_a_shape: int = 1500
    shape_points: int = 750_000
    range_m: float = 80.0
    cell_m: float = 0.2


@dataclass(frozen=True)
class DrawnScan:
    """Points of one scan.

    Attributes:
        frame: of the drive.
        points: `(n, 3)` sensor frame, metres; those on no vehicle first, shuffled, so that the
            first of them are a thinner scan.
        owners: number of the vehicle that each is on, or `NOBODY`.
    """

    frame: int
    points: Points
    owners: Int[np.ndarray, "n"]


_DEFAULT = SceneConfig()


def drawn_scans(
    found: FinishedDrive,
    drive: Drive | None,
    config: SceneConfig = _DEFAULT,
    helpers: Team = ALONE,
) -> list[DrawnScan]:
    """The scans that are drawn, read one by one; without the recording they have no points."""
    frames = _drawn_frames(found, config)
    most = min(config.points_a_scan, config.points // max(1, len(frames)))
    if drive is None:
        return [thinned(frame, _NO_POINTS, {}, most, config) for frame in frames]
    boxes = boxes_by_frame(found)
    each = config.vehicle_points // max(1, sum(len(boxes.get(frame, ())) for frame in frames))
    config = replace(config, points_a_vehicle=max(1, min(config.points_a_vehicle, each)))
    return list(helpers.in_order(_Drawing(drive, boxes, most, config), frames))


def _drawn_frames(found: FinishedDrive, config: SceneConfig) -> list[int]:
    step = -(-len(found) // config.frames) or 1
    frames = set(range(0, len(found), step))
    for one in found.vehicles:
        if frames.isdisjoint(one.frames):
            frames.add(one.fullest)
    return sorted(frames)


@dataclass(frozen=True)
class _Drawing:
    """Reads a scan and makes it ready; fields as `thinned` takes them, of all frames."""

    drive: Drive
    boxes: dict[int, dict[int, Box]]
    most: int
    config: SceneConfig

    def __call__(self, frame: int) -> DrawnScan:
        boxes = self.boxes.get(frame, {})
        return thinned(frame, self.drive.scan(frame), boxes, self.most, self.config)


def boxes_by_frame(found: FinishedDrive) -> dict[int, dict[int, Box]]:
    """By frame and number of the vehicle."""
    boxes: dict[int, dict[int, Box]] = {}
    for number, one in enumerate(found.vehicles):
        for frame, box in zip(one.frames, one.boxes):
            boxes.setdefault(frame, {})[number] = box
    return boxes


def thinned(
    frame: int, scan: Points, boxes: dict[int, Box], most: int, config: SceneConfig = _DEFAULT
) -> DrawnScan:
    """A scan of at most `most` points, and those on vehicles."""
    x, y, _ = np.ascontiguousarray(scan.T)
    near = scan.compress(x * x + y * y < config.range_m**2, axis=0)
    owners = owners_of(near, boxes)
    rest = near.compress(owners == NOBODY, axis=0)
    near, owners = near[owners != NOBODY], owners[owners != NOBODY]
    rest = thin(rest.take(first_of_cells(rest, config.cell_m), axis=0), most)
    rest = rest[np.random.default_rng(0).permutation(len(rest))]
    parts = [thin(near[owners == number], config.points_a_vehicle) for number in boxes]
    counts = [len(part) for part in parts]
    return DrawnScan(
        frame,
        np.concatenate([rest, *parts]),
        np.repeat([NOBODY, *boxes], [len(rest), *counts]).astype(np.int64),
    )


def owners_of(points: Points, boxes: dict[int, Box]) -> Int[np.ndarray, "n"]:
    """Which box each point is in, by the box's number; all in one sensor frame."""
    owners = np.full(len(points), NOBODY)
    along, across = np.ascontiguousarray(points[:, :2].T)
    for number, box in boxes.items():
        half, (x, y, _) = np.asarray(box.size) / 2, box.centre
        reach = np.float32(np.linalg.norm(half) + _AROUND_M)
        close = np.flatnonzero(
            (abs(along - np.float32(x)) < reach) & (abs(across - np.float32(y)) < reach)
        )
        own = (points[close] - np.asarray(box.centre)) @ box_axes(box.quaternion_wxyz)
        inside = (np.abs(own) < half + _AROUND_M).all(1) & (own[:, 2] > _FOOT_M - half[2])
        owners[close[inside]] = number
    return owners


def placed(found: FinishedDrive, one: FoundVehicle) -> Float[np.ndarray, "f 4"]:
    """Centre x, y, z and yaw in the drawing frame, of each of its frames."""
    return upright_places(found.placed(one))


def points_a_shape(found: FinishedDrive, config: SceneConfig = _DEFAULT) -> int:
    """How many of each complete shape are drawn."""
    return min(config.points_a_shape, config.shape_points // max(1, len(found.vehicles)))


def scene_data(
    found: FinishedDrive, scans: Sequence[DrawnScan], config: SceneConfig = _DEFAULT
) -> dict[str, Any]:
    """The scene as JSON values, for the script of the page."""
    frames = [scan.frame for scan in scans]
    most = points_a_shape(found, config)
    return {
        "name": found.name,
        "ground": found.ground_m,
        "timed": found.times is not None,
        "palette": PALETTE,
        "frames": [_frame(found, scan) for scan in scans],
        "vehicles": [_vehicle(found, one, frames, most) for one in found.vehicles],
        "way": found.T_level_sensor.translation.numpy().round(3).tolist(),
    }


def _frame(found: FinishedDrive, scan: DrawnScan) -> dict[str, Any]:
    pose = found.T_level_sensor[scan.frame].matrix[:3].numpy()
    mine = scan.owners[scan.owners != NOBODY] % len(PALETTE)
    return {
        "frame": scan.frame,
        "time": round(found.seconds[scan.frame], 3),
        "pose": pose.round(6).tolist(),
        "owners": mine.tolist(),
        **_packed(scan.points),
    }


def _vehicle(
    found: FinishedDrive, one: FoundVehicle, frames: Sequence[int], most: int
) -> dict[str, Any]:
    """From the `first` to the last of the frames drawn that it is in, null where it is not seen."""
    there = set(one.frames)
    drawn = [number for number, frame in enumerate(frames) if frame in there]
    during = frames[drawn[0] : drawn[-1] + 1]
    places = dict(zip(one.frames, placed(found, one).round(3).tolist()))
    points = dict(zip(one.frames, one.points))
    speeds = found.speeds(one)
    speed = dict(zip(one.frames, speeds or ()))
    return {
        "name": one.name,
        "size": [round(side, 3) for side in one.size],
        "moving": one.moving,
        "confidence": round(one.confidence, 3),
        "chances": chances_in(found.out / "objects" / one.name),
        "first": drawn[0],
        "places": [places.get(frame) for frame in during],
        "points": [points.get(frame, 0) for frame in during],
        "speeds": speeds and [round(speed.get(frame, 0.0), 1) for frame in during],
        "shape": _packed(thin(found.shape(one), most)),
    }


def _packed(points: Points) -> dict[str, Any]:
    if not len(points):
        return {"count": 0, "low": [0, 0, 0], "step": [1, 1, 1], "points": ""}
    low, high = points.min(0).astype(np.float64), points.max(0).astype(np.float64)
    packed, step = quantise(points, low, np.maximum(high, low + 1e-3))
    return {"count": len(points), "low": low.tolist(), "step": step, "points": packed}
