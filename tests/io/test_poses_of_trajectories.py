# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Trajectories come back as they were; their smoothness is that of known motions."""

import json
import math

import numpy as np
import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_from_quaternion, rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.smoothness import smoothness
from wildshape.io.poses import places_of, read_tum, times_of, write_trajectory, write_tum


def drive(count=9, turn_deg=3.0, speed=2.0):
    yaw = torch.deg2rad(turn_deg * torch.arange(count, dtype=torch.float64))
    x = speed * torch.arange(count, dtype=torch.float64)
    return SE3(rotation_z(yaw), torch.stack((x, 0 * x + 5, 0 * x - 1), dim=1))


def test_tum_comes_back(tmp_path):
    generator = torch.Generator().manual_seed(0)
    turn = rotation_from_quaternion(torch.randn(7, 4, generator=generator, dtype=torch.float64))
    poses = SE3(turn, 9 * torch.randn(7, 3, generator=generator, dtype=torch.float64))
    write_tum(tmp_path / "t.tum", poses, range(3, 10))
    times, found = read_tum(tmp_path / "t.tum")
    assert times == list(range(3, 10))
    torch.testing.assert_close(found.matrix, poses.matrix, atol=1e-9, rtol=0)
    # By hand: a quarter turn about z.
    write_tum(tmp_path / "q.tum", drive(2, 90.0)[1:], [4])
    words = [float(word) for word in (tmp_path / "q.tum").read_text().split()]
    half = math.sqrt(0.5)
    assert words == pytest.approx([4, 2, 5, -1, 0, 0, half, half])


@pytest.mark.parametrize(
    "line", ["", "1 2 3", "1 2 3 4\n5 6 7 8", "0 1 2 3 0 0 0 9", "0 1 2 nan 0 0 0 1", "a b"]
)
def test_what_is_no_tum_is_refused(line, tmp_path):
    (tmp_path / "t.tum").write_text(line + "\n")
    with pytest.raises(BadInputError, match="time x y z"):
        read_tum(tmp_path / "t.tum")


def test_even_motion_has_no_second_difference_and_jitter_has():
    even = smoothness(drive())
    assert even is not None
    assert even.translation_mean_m == pytest.approx(0, abs=1e-12)
    assert even.rotation_p95_deg == pytest.approx(0, abs=1e-6)
    poses = drive(turn_deg=0.0)
    poses.translation[4, 1] += 0.1
    jolted = smoothness(poses)
    assert jolted is not None
    # One scan aside by 10 cm is felt three times: 0.1, 0.2, 0.1.
    assert jolted.translation_mean_m == pytest.approx(0.4 / 7)
    turned = SE3(poses.rotation.clone(), drive().translation)
    turned.rotation[4] = rotation_z(torch.tensor(math.radians(2.0), dtype=torch.float64))
    bent = smoothness(turned)
    assert bent is not None
    assert bent.rotation_mean_deg == pytest.approx((2 + 4 + 2) / 7, abs=1e-6)
    assert smoothness(drive(2)) is None


def test_times_are_the_names_where_those_rise():
    assert times_of(["000003", "000007"]) == [3, 7]
    assert times_of(["7", "3"]) == [0, 1]
    assert times_of(["left", "right"]) == [0, 1]
    assert times_of(["000003", "000007"], ["000005.ply"]) == [3, 7]
    assert times_of(["scan_00", "scan_02"], ["scan_01.ply"]) == [0, 2]


def test_places_count_skipped_files_in_the_order_of_names():
    assert places_of(["b", "c", "e"], ["d.ply", "a.ply"]) == [1, 2, 4]
    assert places_of(["a-1", "a"], ["a-0.ply"]) == [1, 2]  # as files are sorted: a-1.ply, a.ply
    assert places_of(["e", "b"], ["c.ply"]) == [0, 1]


def test_json_has_poses_and_figures(tmp_path):
    write_trajectory(tmp_path / "t.json", drive(3), ["000001", "000002", "000005"])
    found = json.loads((tmp_path / "t.json").read_text())
    assert [row["time"] for row in found["poses"]] == [1, 2, 5]
    np.testing.assert_allclose(found["poses"][1]["T_sensor_canonical"], drive(3).matrix[1])
    write_trajectory(tmp_path / "skipped.json", drive(2), ["a", "c"], ["b.ply"])
    skipped = json.loads((tmp_path / "skipped.json").read_text())
    assert [row["time"] for row in skipped["poses"]] == [0, 2]
    assert found["smoothness"]["translation_p95_m"] == pytest.approx(0, abs=1e-12)
    write_trajectory(tmp_path / "t.json", drive(1), ["0"])
    assert json.loads((tmp_path / "t.json").read_text())["smoothness"] is None
