# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Labels of the same time as boxes that were corrected for the sensor's motion.

Labels stand where the beam met a thing. Where points have times, `wildshape drive` takes them, and
so its boxes, to where they are seen from the sensor's place at the scan's time.
"""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from wildshape.datasets.kitti.raw import read_velodyne
from wildshape.evaluation.drives.found import Clusters, FoundDrive
from wildshape.evaluation.drives.labels import Label, LabelledDrive
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import Twist
from wildshape.records import Points

Correction = Literal["none", "labels carried", "labels not carried"]
_FRAMES, _MOVED_M = 5, 0.002  # formats round to a millimetre


def like_found(labelled: LabelledDrive, clusters: Clusters) -> tuple[LabelledDrive, Correction]:
    """Labels at the time of what was found, and how they got there.

    When the beam met a thing is known in simulated drives alone.

    Args:
        labelled: as the beam met it.
        clusters: points of what was found, in `sampled_frames`; without any nothing is taken for
            corrected.
    """
    if not is_corrected(clusters, labelled.scans):
        return labelled, "none"
    if labelled.view is not None or labelled.T_world_sensor is None:
        return labelled, "labels not carried"
    return at_scan_times(labelled, labelled.T_world_sensor), "labels carried"


def sampled_frames(found: FoundDrive) -> set[int]:
    """A few frames with boxes, spread evenly: their points tell whether all were corrected."""
    seen = [number for number, frame in enumerate(found.frames) if frame]
    some = np.linspace(0, len(seen) - 1, min(len(seen), _FRAMES)).round().astype(int)
    return {seen[i] for i in some}


def is_corrected(clusters: Clusters, scans: Sequence[Path]) -> bool:
    """Whether points lie elsewhere than where the sensor measured them.

    Args:
        clusters: points of what was found, in a few frames.
        scans: files of the scans as measured, of KITTI's format.

    Raises:
        BadInputError: a scan is damaged.
    """
    frames: dict[int, list[Points]] = defaultdict(list)
    for (number, _), points in clusters.items():
        frames[number].append(points)
    off = [_off(np.concatenate(parts), scans[number]) for number, parts in frames.items()]
    return bool(off) and float(np.median(np.concatenate(off))) > _MOVED_M


def _off(points: Points, scan: Path) -> np.ndarray:
    """How far points are from a scan's nearest, metres."""
    from scipy.spatial import KDTree

    distance, _ = KDTree(read_velodyne(scan)).query(points)
    return np.asarray(distance)


def at_scan_times(labelled: LabelledDrive, T_world_sensor: SE3) -> LabelledDrive:
    """Labels where they are seen from the sensor's place at each scan's time.

    A vehicle that moves stays where the beam met it, as its points do. The beam comes from behind
    over the right side, the front and the left, and takes from scan to scan.
    """
    numbers = [int(scan.stem) for scan in labelled.scans]
    last, frames = len(numbers) - 1, []
    for i, frame in enumerate(labelled.frames):
        start, end = max(i - 1, 0), min(i + 1, last)
        turns = max(float(numbers[end] - numbers[start]), 1.0)
        motion = Twist.between(T_world_sensor[start], T_world_sensor[end], turns)
        frames.append(replace(frame, labels=tuple(_carried(one, motion) for one in frame.labels)))
    return replace(labelled, frames=tuple(frames))


def _carried(label: Label, motion: Twist) -> Label:
    """A label seen from where the sensor is at the turn's middle; `motion`: per turn."""
    box = label.box
    T_middle_met = motion.after(math.atan2(box.y, box.x) / (2 * math.pi))
    R = T_middle_met.rotation.numpy()
    x, y, z = R @ np.array(box[:3]) + T_middle_met.translation.numpy()
    turned = math.atan2(R[1, 0], R[0, 0])
    return replace(
        label, box=box._replace(x=float(x), y=float(y), z=float(z), yaw=box.yaw + turned)
    )
