# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points of what was found: those kept, and those of boxes where none were."""

import weakref
from pathlib import Path

import numpy as np
import torch
from tests.drives.finished_drive import FRAMES, finished_drive

from wildshape.evaluation.drives.found import Found, FoundDrive, kept_clusters, points_inside
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.geometry.transforms.rotation import rotation_z


def test_points_in_and_close_around_a_turned_box_are_its_own_but_for_the_ground(
    tmp_path: Path,
) -> None:
    box = UprightBox(7.0, -3.0, -0.8, 4.0, 1.8, 1.5, 0.6)
    own = [(0, 0, 0), (2.2, 0, 0), (-2.2, 0.3, 0.1), (0, 1.1, 0), (0.5, -1.1, -0.5), (1, 0, 0.7)]
    others = [(2.4, 0, 0), (-2.4, 0, 0), (0, 1.3, 0), (0, -1.3, 0), (0, 0, -0.6), (0, 0, 0.8)]
    R_sensor_box = rotation_z(torch.tensor(box.yaw, dtype=torch.float64)).numpy()
    scan = np.array((*own, *others)) @ R_sensor_box.T + np.array(box[:3])
    path = tmp_path / "000000.bin"
    np.pad(scan, ((0, 0), (0, 1))).astype("<f4").tofile(path)
    empty = tmp_path / "000001.bin"
    empty.touch()
    drive = FoundDrive(tmp_path, ((Found("4", 0.9, box),), ()), None)
    ((frame, track, found),) = points_inside(drive, [path, empty])
    assert (frame, track) == (0, "4")
    np.testing.assert_array_equal(found, scan[: len(own)].astype(np.float32))


def test_of_the_clusters_kept_one_track_is_held_at_a_time(tmp_path: Path) -> None:
    drive = finished_drive(tmp_path, {str(i): [(12.0, 3.0 * i, 0.2)] * FRAMES for i in range(4)})
    seen, held = [], []
    for frame, track, points in kept_clusters(drive.out):
        seen.append((track, frame))
        held.append((track, weakref.ref(points)))
        alive = {other for other, cluster in held if cluster() is not None}
        assert len(alive) <= 2  # this one, and the one before while this is read
    assert seen == [(str(i), frame) for i in range(4) for frame in range(FRAMES)]
