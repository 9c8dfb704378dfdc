# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Between the frames of a drive: a scan's sensor frame, and the level world in which boxes stand.

The world is the sensor frame of the first frame; the level world is it with z vertical.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float

from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import BoxConfig
from wildshape.drives.source import HALF_TICK, Drive
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.tracking.segmentation import read_cut
from wildshape.drives.tracking.sightings import Sightings
from wildshape.geometry.footprint import upright_places
from wildshape.geometry.transforms.rotation import quaternion_from_rotation, rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.complete_folder import OBJECTS
from wildshape.io.boxes.detections import detections_of, poses_of
from wildshape.io.guard import read_json, reading
from wildshape.records import Box, Points

_LOWER = 0.25  # what is wrongly taken for ground lies too high: it is of a lorry


@dataclass(frozen=True)
class Completed:
    """A completed object in the drive's level world frame (z vertical).

    Attributes:
        seen: in which frames, all of them.
        frames: those of its completed scans.
        boxes: `(k, 4)` centre x, y, z and yaw in each of them.
        size: `(3,)` length, width, height, metres.
        cost_m: label-free cost, the middle one of its scans, the fuller the heavier.
        confidence: of the completions, 0 to 1.
        p_kind: probability that it is a vehicle; None for weights that state none.
        raised_m: how far the boxes' middle was moved up from that of the completed shape.
        phases: `(k,)` when the beam met it, in turns since the middle of each frame's.
        turned: the front of the boxes is the rear of the completed shape.
    """

    seen: Sightings
    frames: tuple[int, ...]
    boxes: Float[np.ndarray, "k 4"]
    size: tuple[float, float, float]
    cost_m: float
    confidence: float
    p_kind: float | None = None
    raised_m: float = 0.0
    phases: Float[np.ndarray, "k"] | float = 0.0
    turned: bool = False

    @property
    def fullest(self) -> int:
        """Points of its fullest scan."""
        return max(self.seen.points)


def level_poses(T_world_sensor: SE3, mounting: Mounting) -> SE3:
    """`T_level_sensor` of every frame: from its sensor frame to the level world."""
    return mounting.levelling() @ T_world_sensor


def as_box_sees(points: Points, box: Float[np.ndarray, "4"]) -> Float[np.ndarray, "n 3"]:
    """Points in the frame of an upright box: x ahead, y left, origin in its middle."""
    off = points - box[:3]
    c, s = np.cos(box[3]), np.sin(box[3])
    turned = (c * off[:, 0] + s * off[:, 1], c * off[:, 1] - s * off[:, 0], off[:, 2])
    return np.stack(turned).T


def read_completed(seen: Sightings, folder: Path, drive: Drive, turns: Turns) -> Completed:
    """A completed object, from where `completion.py` wrote it, in the level world.

    Raises:
        BadInputError: the files are damaged.
    """
    with reading(folder / OBJECTS, "what complete writes"):
        said = read_json(folder / OBJECTS, "what complete writes")
        found = list(detections_of(said, 0))
        place = {name: frame for frame, name in enumerate(drive.scan_names)}
        frames = tuple(place[one.scan] for one in found)
        costs = np.array([float(scan["cost_m"]) for scan in said["scans"]])
        p_kind = _mean([scan.get("p_kind") for scan in said["scans"]])
        size = found[0].box.size
    points = dict(zip(seen.frames, seen.points))
    weights = np.array([points[frame] for frame in frames], float)
    T_level_box = turns.T_level_sensor[torch.tensor(frames)] @ poses_of([one.box for one in found])
    boxes, phases = turns.met(frames, upright_places(T_level_box))
    return Completed(
        seen=seen,
        frames=frames,
        boxes=boxes,
        size=size,
        cost_m=weighted_median(costs, weights),
        confidence=float(np.mean([one.score for one in found])),
        p_kind=p_kind,
        phases=phases,
    )


def on_ground(one: Completed, cuts: Path, turns: Turns, config: BoxConfig) -> Completed:
    """The same vehicle, its boxes from the ground up, as data sets label them.

    What a scan holds of wheels is cut with the ground, and so are the shapes that networks learn.
    """
    length, width, height = one.size
    gaps = one.boxes[:, 2] - height / 2 - _ground(one.seen, one.frames, cuts, turns)
    if np.isnan(gaps).all():
        return one
    gap = float(np.nanmedian(gaps))
    if not abs(gap) <= config.ground_gap_m:  # far off, or not known at all
        return one
    return replace(
        one,
        boxes=one.boxes - (0.0, 0.0, gap / 2, 0.0),
        size=(length, width, height + gap),
        raised_m=-gap / 2,
    )


def on_ground_of_each(
    frames: Sequence[int],
    shown: Float[np.ndarray, "f 4"],
    one: Completed,
    cuts: Path,
    turns: Turns,
    config: BoxConfig,
) -> Float[np.ndarray, "f 4"]:
    """A vehicle's boxes, each on the ground that its frame and those around it show there.

    A wrong pitch of one pose in `T_level_sensor` lifts what is 30 m away by decimetres.

    Args:
        frames: rising.
        shown: its boxes where these frames show them, level world.
        one: the vehicle.
        cuts: folder of the clusters.
        turns: of the drive's sensor.
        config: see there.
    """
    ticks = np.take(turns.ticks, frames).astype(np.float64)
    ground = _ground(one.seen, frames, cuts, turns)
    gaps = shown[:, 2] - one.size[2] / 2 - ground
    is_ground = _usual(ticks, ground, config) | _usual(ticks, -gaps, config)
    gaps = np.where(is_ground, gaps, np.nan)
    gaps = _around(ticks, gaps, config.ground_ticks, 0.5)
    known = ~np.isnan(gaps)
    if not known.any() or abs(np.median(gaps[known])) > config.ground_gap_m:
        return shown
    gaps = np.interp(ticks, ticks[known], gaps[known])
    return shown - gaps[:, None] * (0.0, 0.0, 1.0, 0.0)


def _ground(
    seen: Sightings, frames: Sequence[int], cuts: Path, turns: Turns
) -> Float[np.ndarray, "f"]:
    """Z of the ground under an object's clusters, level world.

    NaN in frames without one, as where its cluster belongs to another vehicle.
    """
    rows, ground = dict(zip(seen.frames, seen.rows)), np.full(len(frames), np.nan)
    places = [i for i, frame in enumerate(frames) if frame in rows]
    if places:
        of = [frames[i] for i in places]
        under = [np.median(read_cut(cuts, f).grounds[list(rows[f])], axis=0) for f in of]
        T_level_sensor = turns.T_level_sensor[torch.tensor(of)]
        level = T_level_sensor.apply(torch.from_numpy(np.stack(under))[:, None])
        ground[places] = level[:, 0, 2].numpy()
    return ground


def _usual(
    ticks: Float[np.ndarray, "f"], heights: Float[np.ndarray, "f"], config: BoxConfig
) -> Bool[np.ndarray, "f"]:
    """Which heights of the ground are as those around them."""
    usual = _around(ticks, heights, config.ground_stray_ticks, _LOWER)
    return np.abs(heights - usual) <= config.ground_stray_m


def _around(
    ticks: Float[np.ndarray, "f"], values: Float[np.ndarray, "f"], reach: int, quantile: float
) -> Float[np.ndarray, "f"]:
    """A quantile of the values up to so many ticks before and after each; NaN are left out."""
    known = np.flatnonzero(~np.isnan(values))
    first = np.searchsorted(ticks[known], ticks - reach - HALF_TICK)
    last = np.searchsorted(ticks[known], ticks + reach + HALF_TICK)
    around = (np.sort(values[known[a:b]]) for a, b in zip(first, last))
    return np.array([_quantile(some, quantile) if len(some) else np.nan for some in around])


def _quantile(rising: Float[np.ndarray, "k"], quantile: float) -> float:
    """As numpy's, which takes ten times as long for a few values."""
    low = int(quantile * (len(rising) - 1))
    high = min(low + 1, len(rising) - 1)
    return rising[low] + (quantile * (len(rising) - 1) - low) * (rising[high] - rising[low])


def _mean(values: list[float | None]) -> float | None:
    known = [float(value) for value in values if value is not None]
    return float(np.mean(known)) if known else None


def weighted_median(values: Float[np.ndarray, "k"], weights: Float[np.ndarray, "k"]) -> float:
    """The value that half of the weight lies below."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(below, below[-1] / 2)]])


def boxes_in_scans(
    boxes: Float[np.ndarray, "k 4"], size: tuple[float, float, float], T_level_sensor: SE3
) -> list[Box]:
    """Boxes of the level world (centre x, y, z and yaw), each in the sensor frame of its frame."""
    upright = SE3(rotation_z(torch.from_numpy(boxes[:, 3])), torch.from_numpy(boxes[:, :3]))
    T_sensor_box = T_level_sensor.inverse() @ upright
    turns = quaternion_from_rotation(T_sensor_box.rotation).tolist()
    return [
        Box((x, y, z), size, (qw, qx, qy, qz))
        for (x, y, z), (qw, qx, qy, qz) in zip(T_sensor_box.translation.tolist(), turns)
    ]
