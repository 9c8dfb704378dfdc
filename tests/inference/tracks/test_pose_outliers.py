# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans that no neighbour agrees with are put where their neighbours are; nothing else moves."""

import math

import pytest
import torch

from wildshape.geometry.transforms.rotation import random_rotation, rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks.pose_outliers import outliers, without_outliers


def passing(count: int = 9) -> SE3:
    """`T_sensor_object` of a sensor that drives past along x, turning by two degrees a scan."""
    x = torch.linspace(8, -8, count, dtype=torch.float64)
    place = torch.stack((x, torch.full_like(x, 3.0), torch.full_like(x, 1.5)), -1)
    rotation = rotation_z(0.3 + torch.arange(count) * math.radians(2)).double()
    return SE3(rotation, -(rotation @ place[..., None])[..., 0])


def gone_astray(poses: SE3, rows: list[int]) -> SE3:
    """Some scans posed a quarter turn off, and a metre beside."""
    turn = SE3(rotation_z(torch.tensor(math.pi / 2)).double(), torch.tensor((1.0, 0.0, 0.0)))
    wrong = poses @ turn.to(torch.float64)
    mask = torch.zeros(len(poses.rotation), dtype=torch.bool)
    mask[rows] = True
    return SE3(
        torch.where(mask[:, None, None], wrong.rotation, poses.rotation),
        torch.where(mask[:, None], wrong.translation, poses.translation),
    )


@pytest.mark.parametrize("rows", [[4], [0], [8], [2, 6], [3, 4], [0, 4, 8]])
def test_quarter_turns_are_found_and_put_back_on_the_way(rows):
    true = passing()
    given = gone_astray(true, rows)
    assert torch.nonzero(outliers(given.rotation))[:, 0].tolist() == rows
    off = (true.inverse() @ without_outliers(given)).angle()
    assert float(torch.rad2deg(off).max()) < 5
    places = (without_outliers(given).inverse().translation - true.inverse().translation).norm(
        dim=-1
    )
    assert float(places.max()) < 1e-5, "the way is straight, so the places are exact"
    kept = [i for i in range(9) if i not in rows]
    assert torch.equal(without_outliers(given).translation[kept], true.translation[kept])


def test_the_nearer_neighbour_that_is_right_gives_its_attitude():
    true = passing()
    found = without_outliers(gone_astray(true, [3, 4]))
    torch.testing.assert_close(found.rotation[3], true.rotation[2])
    torch.testing.assert_close(found.rotation[4], true.rotation[5])


def test_a_steady_track_stays_as_it_is():
    true = passing()
    assert without_outliers(true) is true


def test_scans_that_were_turned_each_on_their_own_are_left_alone():
    true = passing()
    turns = random_rotation(9, torch.Generator().manual_seed(0)).double()
    turned = SE3(turns @ true.rotation, (turns @ true.translation[..., None])[..., 0])
    assert without_outliers(turned) is turned


def test_where_half_contradict_the_others_nobody_knows():
    true = passing(8)
    torn = gone_astray(true, [0, 2, 4, 6])
    assert without_outliers(torn) is torn


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_scans_have_no_majority(count):
    given = gone_astray(passing(count), [0])
    assert without_outliers(given) is given


@pytest.mark.parametrize(("degrees", "off"), [(60, []), (70, [2])])
def test_a_scan_must_differ_from_both_neighbours(degrees, off):
    """Those about it lie 20 degrees apart: from one of them it differs by 40, and then by 50."""
    yaw = torch.tensor([0.0, 0.0, degrees, 20.0, 20.0], dtype=torch.float64)
    assert torch.nonzero(outliers(rotation_z(torch.deg2rad(yaw))))[:, 0].tolist() == off


@pytest.mark.parametrize("degrees", [10, 35, 60])
def test_objects_that_really_turn_are_believed(degrees):
    turning = rotation_z(torch.arange(9) * math.radians(degrees)).double()
    assert not outliers(turning).any()
