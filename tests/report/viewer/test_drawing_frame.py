# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.report.viewer.shown import perfect, track

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.registration import to_middle
from wildshape.report.scene import upright as upright_points
from wildshape.report.viewer.drawing_frame import draw_from_middle, draw_from_sensor, upright
from wildshape.report.viewer.registrations import AFTER, BEFORE, TRUTH, WAYS, moves


def test_a_camera_s_frame_is_turned_as_the_report_turns_it() -> None:
    points = np.arange(12, dtype=np.float64).reshape(4, 3)
    for kind in ("lidar", "camera"):
        np.testing.assert_allclose(upright(kind).apply_numpy(points), upright_points(points, kind))


@pytest.mark.parametrize("hold", ["sensor", "object"])
def test_true_poses_lay_truth_scan_and_fused_scans_over_each_other(hold) -> None:
    shown = track()
    poses = poses_of(shown)
    T_middle_scan = to_middle(poses)
    centres = poses.translation.numpy()
    before = None
    for scan in range(len(shown.scans)):
        T_draw = draw_from_sensor("lidar", centres[scan], centres[2], T_middle_scan[scan], hold)
        T_fused = draw_from_middle(T_draw, T_middle_scan[scan])
        there = T_draw.apply_numpy(shown.scans[scan])
        fused = T_fused.apply_numpy(T_middle_scan[scan].apply_numpy(shown.scans[scan]))
        np.testing.assert_allclose(there, fused, atol=1e-5)
        middle = T_draw.apply_numpy(centres[scan][None])
        np.testing.assert_allclose(middle, 0, atol=1e-6)  # the object stays in view
        if hold == "object":
            still = (T_draw @ poses[scan]).matrix
            before = still if scan == 0 else before
            torch.testing.assert_close(still, before, atol=1e-9, rtol=0)


def test_ways_to_fuse_wait_for_the_scans_and_know_their_error() -> None:
    shown = track()
    assert moves(AFTER, shown, {}) is None
    made = {i: perfect(shown, i) for i in range(5)}
    found = {way: moves(way, shown, made) for way in WAYS}
    for way in (AFTER, TRUTH):
        way_found = found[way]
        assert way_found is not None
        assert way_found.verdict == "0.0°, 0.00 m median; 100 % within 30°"
    before = found[BEFORE]
    assert before is not None
    assert before.error is not None
    assert float(before.error.translation_m.max()) > 0.01


def test_the_middle_scan_against_itself_is_no_test() -> None:
    pair = track(scans=2)
    first, second = perfect(pair, 0), perfect(pair, 1)
    assert first.pose is not None
    half = SE3(rotation_z(torch.tensor(torch.pi, dtype=torch.float64)), torch.zeros(3).double())
    found = moves(AFTER, pair, {0: replace(first, pose=first.pose @ half), 1: second})
    assert found is not None
    assert found.verdict == "180.0°, 0.00 m median; 0 % within 30°"
