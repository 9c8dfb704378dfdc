# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track used as a whole: half turns are voted out, bad refinements refused, one shape posed."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.inference.tracks.known_car import (
    SHAPE,
    TRACK,
    completed,
    each_turned,
    together,
    turned_around,
)
from tests.inference.tracks.spoilt import relative, spoilt
from tests.models import CONFIG, SETTINGS

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.config import InferenceConfig, TrackConfig
from wildshape.inference.predictor import Predictor, load
from wildshape.inference.refine import drawn_to, padded
from wildshape.inference.tracks import joint_icp
from wildshape.inference.tracks.heading_vote import (
    continuous_signs,
    followed_signs,
    half_turn,
    likeness_of_next,
    nearness_of_next,
    slow,
    voted_signs,
)
from wildshape.inference.tracks.pose_outliers import SensorMotion
from wildshape.method.network import ShapePoseNet


@pytest.mark.parametrize("turned", [False, True])
def test_half_turns_are_voted_out_and_poses_come_nearer(turned):
    track = each_turned(TRACK, torch.Generator().manual_seed(0)) if turned else TRACK
    true = poses_of(track)
    start = turned_around(spoilt(true, seed=1, degrees=3.0, metres=0.1), {1, 5})
    done = together(completed(start), track.scans)
    error = [true[i].inverse() @ item.pose for i, item in enumerate(done)]
    assert max(float(torch.rad2deg(e.angle())) for e in error) < 5.0
    # One shape, posed in every scan.
    canonical = [item.pose.inverse().apply_numpy(item.points) for item in done]
    for shape in canonical[1:]:
        np.testing.assert_allclose(shape, canonical[0], atol=1e-4)
    assert all(0 <= item.confidence <= 1 for item in done)
    assert len({item.box.size for item in done}) == 1, "one object has one size"


def test_a_refinement_that_fits_worse_is_not_kept(monkeypatch):
    """True poses, and a refinement that spoils them: the vote stands, and says so."""
    scans, true = list(TRACK.scans), poses_of(TRACK)
    worse = lambda _, poses, *__, **___: spoilt(poses, seed=5, degrees=10.0, metres=0.4)  # noqa: E731
    monkeypatch.setattr(joint_icp, "refine_jointly", worse)
    fit = joint_icp.refine_checked(scans, true, mirror=True)
    assert not fit.refined
    assert fit.T_sensor_object is true


def test_a_refinement_that_leaves_the_vote_far_behind_is_not_kept(monkeypatch):
    scans, true = list(TRACK.scans), poses_of(TRACK)
    start = turned_around(true, {2})
    monkeypatch.setattr(joint_icp, "refine_jointly", lambda *_, **__: true)
    assert not joint_icp.refine_checked(scans, start, mirror=True).refined


def test_scans_sure_of_their_heading_outvote_those_with_the_better_shape():
    true = poses_of(TRACK)
    wrong = {0, 1, 2, 3}
    done = [
        replace(item, confidence=0.9, p_pose=0.1, p_box=0.9)
        if i in wrong
        else replace(item, confidence=0.01, p_pose=0.95, p_box=0.9)
        for i, item in enumerate(completed(turned_around(true, wrong)))
    ]
    found = together(done, TRACK.scans)
    for i, item in enumerate(found):
        assert float(torch.rad2deg((true[i].inverse() @ item.pose).angle())) < 5.0


def test_scans_that_agree_on_a_wrong_place_move_to_the_surer_ones():
    true, hidden = poses_of(TRACK), [2, 3, 4]
    ahead = SE3(torch.eye(3).double(), torch.tensor((0.8, 0.0, 0.0)).double())
    start = stack([true[i] @ ahead if i in hidden else true[i] for i in range(7)])
    scans, odds = list(TRACK.scans), torch.tensor([9.0, 9, 0.1, 0.1, 0.1, 9, 9])

    def off(poses):
        return float((true.inverse() @ poses).translation.norm(dim=-1).max())

    alike = joint_icp.refine_checked(scans, start, mirror=True).T_sensor_object
    told = joint_icp.refine_checked(scans, start, odds, mirror=True).T_sensor_object
    assert off(told) < 0.5 * off(alike)


def test_a_track_follows_the_scans_whose_odds_are_best():
    true = poses_of(TRACK)
    ahead = SE3(torch.eye(3).double(), torch.tensor((0.5, 0.0, 0.0)).double())
    start = stack([true[i] @ ahead if i in (2, 3, 4) else true[i] for i in range(7)])
    stated = zip(completed(start), (0.9, 0.9, 0.01, 0.01, 0.01, 0.9, 0.9))
    done = together([replace(one, confidence=sure) for one, sure in stated], TRACK.scans)
    off = true.inverse() @ stack([one.pose for one in done])
    assert float(off.translation.norm(dim=-1).max()) < 0.1


def test_where_the_sensors_motion_is_known_no_object_turns_by_a_quarter_at_once():
    """The last three scans agree on it, and are as sure as the others."""
    track = each_turned(TRACK, torch.Generator().manual_seed(0))
    true = poses_of(track)
    quarter = SE3(rotation_z(torch.tensor(torch.pi / 2).double()), torch.zeros(3).double())
    start = stack([true[i] @ quarter if i > 3 else true[i] for i in range(7)])
    R_world_sensor = poses_of(TRACK).rotation @ true.rotation.mT
    motion = SensorMotion(R_world_sensor, 0.1 * torch.arange(7).double())
    done = together(completed(start), track.scans, motion=motion)
    off = true.inverse() @ stack([one.pose for one in done])
    assert float(torch.rad2deg(off.angle()).max()) < 5.0


def test_a_scan_that_turned_and_fits_is_not_put_between_its_neighbours():
    """Two far scans agree, the next one is of a sensor that turned: the shape fits it as it is."""
    angle = torch.tensor([0.0, 0.0, 0.0, 0.0, 1.1]).double()
    turn = SE3(rotation_z(angle), torch.zeros(5, 3).double())
    part = TRACK.part([0, 1, 2, 3, 6])
    true = turn @ poses_of(part)
    scans = [turn[i].apply_numpy(scan) for i, scan in enumerate(part.scans)]
    for i, item in enumerate(together(completed(true), scans)):
        assert float(torch.rad2deg((true[i].inverse() @ item.pose).angle())) < 5.0


def test_a_scan_that_fits_nowhere_as_it_is_is_put_between_its_neighbours():
    """A quarter turn, which no vote sees and no fit mends."""
    true = poses_of(TRACK)
    quarter = SE3(rotation_z(torch.tensor(torch.pi / 2).double()), torch.zeros(3).double())
    start = stack([true[i] @ quarter if i == 3 else true[i] for i in range(7)])
    for i, item in enumerate(together(completed(start), TRACK.scans)):
        assert float(torch.rad2deg((true[i].inverse() @ item.pose).angle())) < 5.0


def test_the_box_of_a_track_reaches_down_as_those_of_its_scans_do():
    """Each has its wheels elsewhere, so that of the mean shape none reach the ground."""
    poses, ground = poses_of(TRACK), SHAPE[:, 2].min()
    without_wheels = SHAPE.clone()
    without_wheels[:, 2].clamp_(min=ground + 0.2)
    done = [
        replace(one, points=poses[i].apply(without_wheels).float().numpy())
        for i, one in enumerate(completed(poses))
    ]
    clouds = [torch.from_numpy(scan).double() for scan in TRACK.scans]
    heights = [poses[i].inverse().apply(cloud)[:, 2] - ground for i, cloud in enumerate(clouds)]
    scans = [cloud[high > 0.25].float().numpy() for cloud, high in zip(clouds, heights)]
    box = together(done, scans)[0].box
    assert box.size[2] == pytest.approx(done[0].box.size[2], abs=0.03)


def test_a_better_refinement_is_kept():
    start = spoilt(poses_of(TRACK), seed=1)
    fit = joint_icp.refine_checked(list(TRACK.scans), start, mirror=True)
    assert fit.refined
    off = [
        float((relative(poses_of(TRACK)).inverse() @ relative(poses)).angle().mean())
        for poses in (fit.T_sensor_object, start)
    ]
    assert off[0] < 0.7 * off[1]


def test_one_scan_is_completed_as_ever():
    predictor, done = Predictor(ShapePoseNet(CONFIG), SETTINGS), completed(poses_of(TRACK)[:1])
    assert list(predictor.put_together(done, TRACK.scans[:1])) == done
    scan, shipped = TRACK.scans[3].astype(np.float32), load()
    (together,) = shipped.complete_track([scan])
    np.testing.assert_array_equal(together.points, shipped.complete(scan).points)


def test_of_a_long_track_key_scans_are_fitted_to_each_other_and_the_others_to_them():
    true = poses_of(TRACK)
    start, few = spoilt(true, seed=1), TrackConfig(key_scans=4)
    fit = joint_icp.refine_checked(list(TRACK.scans), start, mirror=True, config=few)
    assert fit.refined
    before, after = (
        (relative(true).inverse() @ relative(poses)).angle()
        for poses in (start, fit.T_sensor_object)
    )
    others = [1, 3, 5]
    assert float(after[others].mean()) < 0.7 * float(before[others].mean())


def test_of_a_long_track_the_key_scans_alone_are_completed_each_on_its_own(monkeypatch):
    """All scans get a result; of those between the key scans the look is enough."""
    torch.manual_seed(0)
    config = InferenceConfig(track=TrackConfig(key_scans=3))
    predictor = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS, config=config)
    completed_alone = []

    def complete_looked(looked, sensor=None, *, dense=True):
        completed_alone.extend(looked.scans)
        return Predictor.complete_looked(predictor, looked, sensor, dense=dense)

    monkeypatch.setattr(predictor, "complete_looked", complete_looked)
    scans = [scan.astype(np.float32) for scan in TRACK.scans]
    done = predictor.complete_track(scans)
    assert len(done) == len(scans)
    assert [id(one) for one in completed_alone] == [id(scans[i]) for i in (0, 3, 6)]
    assert len({item.box.size for item in done}) == 1
    alone = [predictor.complete(scan) for scan in scans]
    assert [item.branch for item in done] == [item.branch for item in alone]
    assert [item.warning for item in done] == [item.warning for item in alone]


def test_all_of_a_long_track_look_one_way():
    """Where the object turns fast its neighbours say less of each other than elsewhere."""
    generator = torch.Generator().manual_seed(2)
    step = torch.linspace(0.0, 0.2, 600, dtype=torch.float64)
    back = torch.rand(600, generator=generator) < 0.3
    rotation = rotation_z(step.cumsum(0) + torch.where(back, torch.pi, 0.0))
    signs = continuous_signs(rotation)
    assert torch.equal(signs < 0, back) or torch.equal(signs > 0, back)


def test_slow_turns_are_told_from_scans_turned_each_on_their_own():
    steady = rotation_z(torch.linspace(0, 0.5, 8))
    flipped = torch.where(torch.arange(8) % 3 == 1, 3.1416, 0.0)
    assert slow(steady)
    assert slow(rotation_z(torch.linspace(0, 0.5, 8) + flipped))
    generator = torch.Generator().manual_seed(1)
    wild = [rotation_z(6.28 * torch.rand(8, generator=generator)) for _ in range(20)]
    assert not any(slow(rotation) for rotation in wild)
    assert not slow(steady[:3])


def test_the_heavier_part_says_which_way():
    yaw = torch.linspace(0.0, 0.5, 6)
    back = torch.tensor([False, True, False, True, False, False])
    rotation = rotation_z(torch.where(back, yaw + torch.pi, yaw))
    assert torch.equal(followed_signs(rotation, torch.ones(6)) < 0, back)
    heavy = torch.where(back, 0.9, 0.3)
    assert torch.equal(followed_signs(rotation, heavy) > 0, back)
    assert set(continuous_signs(rotation).tolist()) == {-1.0, 1.0}


def test_turned_each_on_their_own_the_shape_and_the_neighbours_vote():
    """One scan that the shape is unsure of follows its neighbours; a sure shape is followed, and
    where neither says anything, the scan itself, if it is sure."""
    alike = torch.full((4,), 0.1)
    unsure = torch.tensor((0.05, 0.05, -0.01, 0.05, 0.05))
    assert voted_signs(unsure, alike, torch.ones(5)).tolist() == [1.0] * 5
    opposed = torch.tensor((0.1, -0.1, -0.1, 0.1))
    assert voted_signs(unsure, opposed, torch.ones(5)).tolist() == [1, 1, -1, 1, 1]
    alone = torch.zeros(4)
    assert voted_signs(unsure, alone, torch.zeros(5)).tolist() == [1, 1, -1, 1, 1]
    assert voted_signs(unsure, alone, torch.ones(5)).tolist() == [1.0] * 5
    sure = torch.tensor((0.05, 0.05, -0.1, 0.05, 0.05))
    assert voted_signs(sure, alone, torch.ones(5)).tolist() == [1, 1, -1, 1, 1]


def test_scans_posed_alike_lie_on_each_other():
    true = poses_of(TRACK)
    for poses, sign in ((true, 1), (turned_around(true, {1, 3, 5}), -1)):
        clouds = torch.stack(
            [
                poses[i].inverse().apply(torch.from_numpy(scan[:300]).double())
                for i, scan in enumerate(TRACK.scans)
            ]
        )
        likeness = likeness_of_next(clouds.float(), 0.0, mirror=True)
        assert bool((sign * likeness > 0.01).all())


def test_scans_of_opposite_ends_say_little_of_each_other():
    """Between them the sensor passed by: in neither heading does one lie on the other."""
    clouds = torch.zeros(2, 100, 3)
    clouds[0, :, 0], clouds[1, :, 0] = 2.0, -1.5
    clouds[:, :, 1] = torch.linspace(-0.9, 0.9, 100)
    one_end = likeness_of_next(clouds, 0.0, mirror=True)
    assert float(one_end.abs()) < 1e-3
    clouds[1, :, 0] = 2.0
    assert float(likeness_of_next(clouds, 0.0, mirror=True)) > 0.5


def test_drawn_to_what_was_seen_and_nowhere_else():
    """A plane a hand's breadth off is drawn to the seen half; the other half stays."""
    axis = torch.linspace(-1, 1, 26, dtype=torch.float64)
    x, y = torch.meshgrid(axis, axis, indexing="ij")
    flat = torch.stack((x.flatten(), y.flatten(), torch.zeros(676).double()), dim=1)
    seen = flat[flat[:, 0] > 0].float()
    lifted = flat + torch.tensor((0.0, 0.0, 0.08)).double()
    drawn = drawn_to(lifted[None], padded([seen]))[0]
    near, far = flat[:, 0] > 0.2, flat[:, 0] < -0.5
    assert float(drawn[near, 2].abs().max()) < 0.03
    torch.testing.assert_close(drawn[far], lifted[far], atol=1e-3, rtol=0)


def test_the_predictor_uses_tracks():
    torch.manual_seed(0)
    predictor = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS)
    scans = [scan.astype(np.float32) for scan in TRACK.scans]
    done = predictor.complete_track(scans)
    assert len(done) == len(scans)
    middle = done[len(done) // 2].pose
    T_middle_scan = predictor.register_track(scans, track=True)
    torch.testing.assert_close(T_middle_scan[0].matrix, (middle @ done[0].pose.inverse()).matrix)
    fused = predictor.fuse(scans, track=True)
    assert len(fused) == sum(map(len, scans))
    moved = T_middle_scan[0].apply_numpy(scans[0])
    np.testing.assert_allclose(fused[: len(moved)], moved, atol=1e-5)


@pytest.mark.parametrize("key_scans", [3, 40])
def test_the_order_of_points_does_not_matter(key_scans):
    torch.manual_seed(0)
    config = InferenceConfig(track=TrackConfig(key_scans=key_scans))
    predictor = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS, config=config)
    scans = [scan.astype(np.float32) for scan in TRACK.scans]
    rng = np.random.default_rng(3)
    shuffled = [rng.permutation(scan) for scan in scans]
    for one, other in zip(*map(predictor.complete_track, (scans, shuffled)), strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        assert one.box == other.box
        assert one.confidence == other.confidence


def test_a_sensor_is_near_where_it_was_before():
    """Said of each pair of neighbours, whatever the sensor's own turns; a leap says little."""
    sensors = poses_of(TRACK).inverse().translation
    links = nearness_of_next(sensors, 0.0)
    assert bool((links > 0).all())
    turned = sensors.clone()
    turned[3] = half_turn(0.4).apply(sensors[3:4])[0]
    opposed = nearness_of_next(turned, 0.4)
    assert (opposed < 0).tolist() == [False, False, True, True, False, False]
    sparse = torch.tensor([(x, 3.0, 0.0) for x in (24.0, 8.0, -8.0, -24.0)], dtype=torch.float64)
    leap = nearness_of_next(sparse, 0.0)[1]
    assert abs(float(leap)) < 0.1 * float(links.min())
