# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The points in the boxes of somebody else's detector, cut out of the scans of a drive."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float

from wildshape.drives.config import DetectionConfig, DriveConfig
from wildshape.drives.tracking.detections import Detections
from wildshape.drives.tracking.segmentation import CutScan, Cutter
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.io.boxes.detections import pose_of
from wildshape.io.boxes.detector import DetectorBox
from wildshape.records import Box, Points


@dataclass(frozen=True)
class BoxCutter(Cutter):
    """Cuts what is in the boxes out of the scans of a drive."""

    detections: Detections

    def cut(
        self, frame: int, scan: Points, heights: Float[np.ndarray, "n"], as_measured: Points
    ) -> CutScan:
        """What is in the boxes of a frame; see `cut_boxes`."""
        given = self.detections
        seen, boxes = as_measured, given.frames[frame]
        if given.corrected:  # of a drive, whose boxes stand on the ground
            seen = scan
            if self.mounting.is_tilted:
                boxes = tuple(replace(one, box=_stood(one.box, self.mounting.up)) for one in boxes)
        return cut_boxes(scan, boxes, heights, self.config, seen, tracked=given.tracked)


def _stood(box: Box, up: Sequence[float]) -> Box:
    """A box along the sensor's z, stood along the vertical: its yaw stays as the sensor sees it."""
    ahead = pose_of(box).rotation[:, 0].numpy().copy()
    ahead[2] = -(ahead[:2] @ up[:2]) / up[2]
    ahead /= np.linalg.norm(ahead)
    axes = torch.from_numpy(np.stack((ahead, np.cross(up, ahead), up), axis=1))
    qw, qx, qy, qz = quaternion_from_rotation(axes).tolist()
    return replace(box, quaternion_wxyz=(qw, qx, qy, qz))


def cut_boxes(
    scan: Points,
    boxes: tuple[DetectorBox, ...],
    heights: Float[np.ndarray, "n"],
    config: DriveConfig,
    as_measured: Points,
    *,
    tracked: bool,
) -> CutScan:
    """The points in each box that are not ground.

    Args:
        scan: whole, sensor frame, metres; it may be empty.
        boxes: in it.
        heights: of its points above the ground.
        config: see there.
        as_measured: the scan on which the boxes lie, if this one was corrected for motion.
        tracked: every box knows its track; else no point is of two.
    """
    stands = np.nan_to_num(heights, nan=0.0) > config.clusters.lowest_m
    above = np.flatnonzero(stands)
    inside = points_in_boxes(as_measured[above], [one.box for one in boxes], config.detections)
    if not tracked:
        inside = _told_apart(inside, boxes, config.detections)
    found = [(one, above[own]) for one, own in zip(boxes, inside)]
    full = [(one, own) for one, own in found if len(own) >= config.detections.fewest_points]
    rows = np.concatenate([above[:0], *(own for _, own in full)])
    return CutScan(
        points=scan[rows],
        rows=rows.astype(np.int32),
        counts=np.array([len(own) for _, own in full], np.int64),
        scanned=len(scan),
        tracks=tuple(one.track for one, _ in full if one.track is not None),
    )


def points_in_boxes(
    points: Points, boxes: list[Box], config: DetectionConfig
) -> Bool[np.ndarray, "k n"]:
    """Which points belong to each box: those in it, and those around it that are in no other."""
    apart = [np.abs(pose_of(box).inverse().apply_numpy(points)) for box in boxes]
    halves = [np.asarray(box.size) / 2 for box in boxes]
    shape = len(boxes), len(points)
    inside = np.array([(a <= h).all(-1) for a, h in zip(apart, halves)], bool).reshape(shape)
    reach = config.around_m
    around = np.array([(a <= h + reach).all(-1) for a, h in zip(apart, halves)], bool)
    return inside | (around.reshape(shape) & ~inside.any(0))


def _told_apart(
    inside: Bool[np.ndarray, "k n"], boxes: tuple[DetectorBox, ...], config: DetectionConfig
) -> Bool[np.ndarray, "k n"]:
    """Each point given to the surest of its boxes; a box that then has hardly any has none.

    A detector may find one vehicle twice, for example as car and as truck.
    """
    free = np.ones(inside.shape[1], bool)
    found = np.zeros_like(inside)
    for row in sorted(range(len(boxes)), key=lambda row: -(boxes[row].score or 0.0)):
        own = inside[row] & free
        if own.sum() >= (1 - config.shared) * inside[row].sum():
            found[row] = own
            free &= ~own
    return found


def check_cut(detections: Detections, cuts: Iterable[CutScan]) -> None:
    """Refuse boxes that miss all points: they are in another frame.

    Raises:
        BadInputError: no box holds enough points.
    """
    if not any(len(cut.counts) for cut in cuts):
        raise BadInputError(
            f"{detections.path}: no box holds the points of a vehicle; boxes must be in each scan's"
            " own sensor frame (KITTI's labels: pass their calibration)."
        )
