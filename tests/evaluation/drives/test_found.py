# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points of found boxes, where a drive's own clusters were not kept."""

from pathlib import Path

import numpy as np
import torch

from wildshape.evaluation.drives.found import Found, FoundDrive, points_inside
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
    found = points_inside(drive, [path, empty])
    assert found.keys() == {(0, "4")}
    np.testing.assert_array_equal(found[0, "4"], scan[: len(own)].astype(np.float32))
