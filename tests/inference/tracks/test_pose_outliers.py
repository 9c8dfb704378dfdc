# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans that no neighbour agrees with are put where their neighbours are; nothing else moves."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from wildshape.geometry.transforms.rotation import (
    random_rotation,
    rotation_from_vector,
    rotation_z,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks.pose_outliers import (
    SensorMotion,
    outliers,
    without_leaps,
    without_outliers,
)

HALF = torch.tensor((2.0, 0.9, 0.7), dtype=torch.float64)
SHAPE = torch.cartesian_prod(*(torch.linspace(-1, 1, 9, dtype=torch.float64) for _ in range(3)))
SHAPE = SHAPE[(SHAPE.abs() == 1).any(1)] * HALF
SURE = torch.full((9,), 0.9, dtype=torch.float64)


def passing(count: int = 9, degrees: float = 2.0) -> SE3:
    """`T_sensor_object` of a sensor that drives past along x, turning by some degrees a scan."""
    x = torch.linspace(8, -8, count, dtype=torch.float64)
    place = torch.stack((x, torch.full_like(x, 3.0), torch.full_like(x, 1.5)), -1)
    rotation = rotation_z(0.3 + torch.arange(count) * math.radians(degrees)).double()
    return SE3(rotation, -(rotation @ place[..., None])[..., 0])


def following(count: int = 8) -> SE3:
    """`T_sensor_object` of a sensor that drives behind, first a little aside."""
    yaw = torch.linspace(0.5, 0.0, count, dtype=torch.float64)
    away = torch.stack((torch.full_like(yaw, 8.0), torch.linspace(-3, 0, count), 0 * yaw - 1.0), -1)
    return SE3(rotation_z(yaw), away.double())


def seen_in(poses: SE3) -> list[np.ndarray]:
    """Of each scan the sides of the object that face the sensor."""
    sensors = poses.inverse().translation
    scans = []
    for i, sensor in enumerate(sensors):
        beyond = (sensor * SHAPE.sign() > HALF) & (SHAPE.abs() == HALF)
        scans.append(poses[i].apply_numpy(SHAPE[beyond[:, :2].any(1)].numpy()))
    return scans


def put_back(given: SE3, true: SE3, sure: Tensor | None = None) -> SE3:
    known = SURE[: len(true.rotation)] if sure is None else sure
    return without_outliers(given, seen_in(true), SHAPE, known)


def off_by(found: SE3, true: SE3) -> tuple[float, float]:
    """Degrees and metres, of the worst scan."""
    apart = true.inverse() @ found
    return float(torch.rad2deg(apart.angle()).max()), float(apart.translation.norm(dim=-1).max())


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
def test_quarter_turns_are_found_and_put_back_where_their_scans_are(rows):
    true = passing()
    given = gone_astray(true, rows)
    assert torch.nonzero(outliers(given.rotation))[:, 0].tolist() == rows
    found = put_back(given, true)
    degrees, metres = off_by(found, true)
    assert degrees < 1e-4
    assert metres < 0.1, "but for strays, where the scan begins"
    kept = [i for i in range(9) if i not in rows]
    assert torch.equal(found.translation[kept], true.translation[kept])


def test_a_scan_put_back_lies_on_its_object_in_whichever_frame_that_is_known():
    """Behind a lorry: as far ahead as its rear, its middle where that is; as high as before it.

    The sensor leans, the object's origin is not its middle, and of the scan the highest and lowest
    points are missing and one is astray.
    """
    straight, off_centre = following(), torch.tensor((0.7, -0.3, 0.4), dtype=torch.float64)
    straight.translation[:, 1] += 0.5
    lean = rotation_from_vector(torch.tensor((0.2, -0.1, 0.0), dtype=torch.float64))
    T_leaning_sensor = SE3(lean, torch.zeros(3, dtype=torch.float64))
    T_object_middle = SE3(torch.eye(3, dtype=torch.float64), off_centre)
    true = T_leaning_sensor @ straight @ T_object_middle.inverse()
    scans = seen_in(T_leaning_sensor @ straight)
    height = scans[7] @ true[7].rotation.numpy()[:, 2]
    between = scans[7][(height > height.min() + 0.2) & (height < height.max() - 0.15)]
    scans[7] = np.concatenate((between, between[:1] * 0.3))
    given = gone_astray(true, [7])
    found = without_outliers(given, scans, SHAPE + off_centre, SURE[:8])
    degrees, metres = off_by(found, true)
    assert degrees < 1e-4
    assert metres < 0.1


def test_what_no_quarter_turn_explains_takes_its_neighbours_attitude():
    true = passing()
    askew = gone_astray(true, [3])
    tilt = rotation_from_vector(torch.tensor((1.2, 0.0, 0.0), dtype=torch.float64))
    askew.rotation[3] = askew.rotation[3] @ tilt
    found = put_back(askew, true)
    torch.testing.assert_close(found.rotation[3], true.rotation[2])


@pytest.mark.parametrize("rows", [[5, 6, 7], [3, 4, 5, 6, 7], [0, 1], [2, 3, 4]])
def test_unsure_scans_in_a_row_are_put_where_the_surer_ones_say(rows):
    """Behind a lorry: one scan after the other takes its rear for its side."""
    true = following()
    sure = torch.full((8,), 0.9, dtype=torch.float64)
    sure[rows] = 0.3
    degrees, metres = off_by(put_back(gone_astray(true, rows), true, sure), true)
    assert degrees < 1e-4
    assert metres < 0.1


@pytest.mark.parametrize(("rows", "degrees"), [([7, 8], -10), ([0, 1], 10)])
def test_unsure_scans_are_held_against_the_nearest_of_the_surer_ones(rows, degrees):
    """Those turn by 60 degrees: the farthest of them is posed as the unsure ones are."""
    poses = passing(degrees=degrees)
    sure = SURE.clone()
    sure[rows] = 0.3
    turned, moved = off_by(put_back(gone_astray(poses, rows), poses, sure), poses)
    assert turned < 25
    assert moved < 0.5


def test_of_three_scans_the_unsure_one_is_put_back():
    true = following(3)
    sure = torch.tensor([0.9, 0.9, 0.2], dtype=torch.float64)
    degrees, _ = off_by(put_back(gone_astray(true, [2]), true, sure), true)
    assert degrees < 1e-4


def test_of_three_scans_one_nearly_as_sure_stays():
    true = following(3)
    turned = gone_astray(true, [2])
    assert put_back(turned, true, torch.tensor([0.9, 0.9, 0.8], dtype=torch.float64)) is turned


def test_a_scan_surer_than_the_others_stays():
    true, sure = passing(), SURE.clone()
    sure[4] = 0.95
    turned = gone_astray(true, [4])
    assert put_back(turned, true, sure) is turned


def test_a_few_scans_however_sure_turn_no_longer_run():
    true = following()
    turned = gone_astray(true, [6, 7])
    sure = torch.tensor([0.6] * 6 + [0.9] * 2, dtype=torch.float64)
    assert put_back(turned, true, sure) is turned


def test_a_run_as_sure_as_the_others_stays():
    true = following()
    turned = gone_astray(true, [5, 6, 7])
    assert put_back(turned, true, torch.full((8,), 0.9, dtype=torch.float64)) is turned


def swerving(true: SE3) -> tuple[SE3, Tensor]:
    """The same poses seen by a sensor that turns about itself, and its `R_world_sensor`."""
    turn = rotation_z(torch.arange(len(true), dtype=torch.float64) * math.radians(50))
    R_sensor_world = SE3(turn.mT, torch.zeros(len(true), 3, dtype=torch.float64))
    return R_sensor_world @ true, turn


@pytest.mark.parametrize(("rows", "turns"), [([5, 6, 7], 1), ([0, 3], 1), ([2, 6, 7], 2)])
def test_no_vehicle_turns_by_a_quarter_within_two_seconds(rows, turns):
    """Scans as sure as the others are put back, however the sensor itself turns meanwhile."""
    true, R_world_sensor = swerving(following())
    given = true
    for _ in range(turns):
        given = gone_astray(given, rows)
    motion = SensorMotion(R_world_sensor, 0.4 * torch.arange(8))
    found = without_leaps(given, seen_in(true), SHAPE, SURE[:8], motion)
    degrees, metres = off_by(found, true)
    assert degrees < 1e-4
    assert metres < 0.1


def test_the_longer_between_two_scans_the_more_a_vehicle_may_turn():
    """By 80 degrees in the 3.6 s in which all scans are astray; those before and after stay."""
    true, rows = passing(degrees=20), [2, 3, 4]
    motion = SensorMotion(torch.eye(3, dtype=torch.float64).expand(9, 3, 3), 0.9 * torch.arange(9))
    given = gone_astray(true, rows)
    found = without_leaps(given, seen_in(true), SHAPE, SURE, motion)
    assert off_by(found, true)[0] < 1e-4
    kept = [i for i in range(9) if i not in rows]
    assert torch.equal(found.translation[kept], true.translation[kept])


def test_one_scan_gone_astray_leads_no_others_with_it():
    """After the gap it might have turned so far; the scans that follow say that it did not."""
    true = following()
    given = gone_astray(true, [4])
    seconds = torch.tensor([0, 0.4, 0.8, 1.2, 6.0, 6.4, 6.8, 7.2])
    motion = SensorMotion(torch.eye(3, dtype=torch.float64).expand(8, 3, 3), seconds)
    degrees, _ = off_by(without_leaps(given, seen_in(true), SHAPE, SURE[:8], motion), true)
    assert degrees < 1e-4


@pytest.mark.parametrize("gap", [2.7, 6.0])
def test_a_vehicle_may_turn_a_corner_where_nobody_sees_it(gap):
    turned = gone_astray(following(), [5, 6, 7])
    seconds = torch.tensor([0, 0.4, 0.8, 1.2, 1.6, gap, gap + 0.4, gap + 0.8])
    motion = SensorMotion(torch.eye(3, dtype=torch.float64).expand(8, 3, 3), seconds)
    found = without_leaps(turned, seen_in(turned), SHAPE, SURE[:8], motion)
    assert torch.equal(found.rotation, turned.rotation)
    assert torch.equal(found.translation, turned.translation)


def test_a_steady_track_stays_as_it_is():
    true = passing()
    assert put_back(true, true) is true


def test_scans_that_were_turned_each_on_their_own_are_left_alone():
    true = passing()
    turns = random_rotation(9, torch.Generator().manual_seed(0)).double()
    turned = SE3(turns @ true.rotation, (turns @ true.translation[..., None])[..., 0])
    assert put_back(turned, true) is turned


def test_where_half_contradict_the_others_nobody_knows():
    true = passing(8)
    torn = gone_astray(true, [0, 2, 4, 6])
    assert put_back(torn, true) is torn


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_scans_have_no_majority(count):
    true = passing(count)
    given = gone_astray(true, [0])
    assert put_back(given, true) is given


@pytest.mark.parametrize(("degrees", "off"), [(60, []), (70, [2])])
def test_a_scan_must_differ_from_both_neighbours(degrees, off):
    """Those about it lie 20 degrees apart: from one of them it differs by 40, and then by 50."""
    yaw = torch.tensor([0.0, 0.0, degrees, 20.0, 20.0], dtype=torch.float64)
    assert torch.nonzero(outliers(rotation_z(torch.deg2rad(yaw))))[:, 0].tolist() == off


def test_a_scan_that_as_many_neighbours_are_for_as_against_stays():
    yaw = torch.tensor([0, 0, 0, 60, 0, 0, 60, 0, 0, 0], dtype=torch.float64)
    assert torch.nonzero(outliers(rotation_z(torch.deg2rad(yaw))))[:, 0].tolist() == [3, 6]


def test_at_least_half_of_the_scans_stay_whichever_are_turned():
    turned = torch.cartesian_prod(*[torch.tensor((0.0, math.pi / 2), dtype=torch.float64)] * 8)
    assert max(int(outliers(rotation_z(yaw)).sum()) for yaw in turned) <= 4


@pytest.mark.parametrize("degrees", [10, 35, 60])
def test_objects_that_really_turn_are_believed(degrees):
    turning = rotation_z(torch.arange(9) * math.radians(degrees)).double()
    assert not outliers(turning).any()
