# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One object of all scans: its shape, box and confidence, whatever its size and its frame."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from tests.cars import drive_by, poses_of
from tests.inference.tracks.known_car import (
    BOX,
    SHAPE,
    TRACK,
    completed,
    each_turned,
    together,
    turned_around,
)
from tests.inference.tracks.spoilt import spoilt
from tests.models import CONFIG, SETTINGS

from wildshape.geometry.box import FittedBox
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.projection.visibility import FacingBins
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.boxes import carried
from wildshape.inference.config import BoxConfig, ReasonRule, TrackConfig
from wildshape.inference.single_scans import Found, Looked
from wildshape.inference.tracks import complete_track as whole
from wildshape.inference.tracks.heading_vote import half_turn
from wildshape.inference.tracks.track_cost import network_inputs


def test_the_mean_shape_counts_scans_by_their_odds():
    """Of weights without probabilities these are the confidence."""
    gathered, poses = whole.Gathered(SETTINGS), poses_of(TRACK)
    for i, (confidence, factor) in enumerate(((0.9, 1.0), (0.3, 1.2))):
        points = poses[i].apply(factor * SHAPE).float().numpy()
        done = replace(completed(poses)[i], points=points, confidence=confidence)
        gathered.add(done, TRACK.scans[i])
    expected = (0.9 * SHAPE + 0.3 * 1.2 * SHAPE) / 1.2
    torch.testing.assert_close(gathered.shape, expected[: CONFIG.points], atol=1e-5, rtol=0)


def test_a_scan_that_the_network_was_not_made_for_has_no_confidence():
    done = [replace(item, confidence=0.1 * i) for i, item in enumerate(completed(poses_of(TRACK)))]
    done[2] = replace(done[2], warning="far too large")
    stated = [item.confidence for item in together(done, TRACK.scans)]
    assert stated == pytest.approx([0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.3])


def test_the_box_is_laid_around_what_no_ray_passed(monkeypatch):
    laid, box = [], whole._box

    def around(shape, *args, **options):
        laid.append(len(shape))
        return box(shape, *args, **options)

    monkeypatch.setattr(whole, "_box", around)
    monkeypatch.setattr(whole, "without_free_space", lambda shape, *_: shape[:500])
    done = completed(poses_of(TRACK))[:2]
    passed = SightLines.of_returns(TRACK.scans[1][:5])
    for rays in ((), (None, passed)):
        assert len(together(done, TRACK.scans, rays=rays)[0].points) == CONFIG.points
    assert laid == [CONFIG.points, 500]


def test_shapes_of_scans_turned_towards_their_object_become_denser():
    done = completed(poses_of(TRACK))[:2]
    facing = together(done, TRACK.scans, replace(SETTINGS, facing=True))
    assert len(facing[0].points) == 2 * CONFIG.points


def test_ground_beside_a_car_goes_unless_the_network_completes_it_too():
    poses = poses_of(TRACK)
    high, low = SHAPE.amax(0), SHAPE.amin(0)
    beside = torch.stack((torch.linspace(-2, 2, 60), torch.full((60,), 1.15), low[2].expand(60)), 1)
    ground = poses[0].apply(beside.double()).float().numpy()
    scan, done = np.concatenate((TRACK.scans[0], ground)), completed(poses)[0]
    for sensor, refined, gone in (
        ("lidar", True, True),
        ("lidar", False, False),
        ("camera", True, False),
    ):
        gathered = whole.Gathered(replace(SETTINGS, sensor=sensor))
        gathered.add(replace(done, refined=refined), scan)
        left = poses[0].inverse().apply_numpy(gathered.scans[0])
        assert (left[:, 1].max() < high[1] + 0.1) == gone


def test_the_shape_of_a_track_is_drawn_to_what_its_scans_saw():
    """The network's is 5 cm too wide on either side."""
    done, wide = completed(poses_of(TRACK)), SHAPE * torch.tensor((1.0, 0.9 / 0.85, 1.0))
    done = [replace(one, points=one.pose.apply(wide).float().numpy()) for one in done]
    found = together(done, TRACK.scans)[0]
    shape = found.pose.inverse().apply_numpy(found.points)
    wall = (np.abs(shape[:, 0]) < 1.5) & (np.abs(shape[:, 2] + 0.25) < 0.2)
    assert np.abs(shape[wall, 1]).mean() == pytest.approx(0.85, abs=0.01)


def test_what_exact_scans_saw_is_in_the_shape_of_their_track():
    """As in that of one scan; without it chairs lost their legs to the mean of all views."""
    done = completed(poses_of(TRACK))[:3]
    apart = {}
    for sensor in ("lidar", "camera"):
        settings = replace(SETTINGS, facing=True, sensor=sensor)
        found = together(done, TRACK.scans, settings)
        trees = [KDTree(one.points) for one in found]
        apart[sensor] = [tree.query(s)[0].mean() for tree, s in zip(trees, TRACK.scans)]
        assert len({len(one.points) for one in found}) == 1
    assert np.mean(apart["camera"]) < 0.5 * np.mean(apart["lidar"])


def test_a_scan_that_lies_far_off_leaves_no_points_in_the_shape_of_its_track():
    """Its pose is wrong, which no neighbour can tell where all are far apart."""
    done = completed(poses_of(TRACK))
    astray = done[3].pose
    moved = SE3(astray.rotation, astray.translation + torch.tensor((0.0, 0.0, 2.0)))
    done[3] = replace(done[3], pose=moved, confidence=0.01)
    found = together(done, TRACK.scans, replace(SETTINGS, facing=True, sensor="camera"))
    T_object_sensor = found[0].pose.inverse()
    off = KDTree(SHAPE).query(T_object_sensor.apply_numpy(found[0].points))[0]
    assert off.max() < 0.5


@pytest.mark.parametrize("sensor", ["lidar", "camera"])
def test_of_objects_half_as_large_all_lengths_are_half_as_large(sensor):
    """One scan of them looks back."""
    large = replace(SETTINGS, sensor=sensor, extent_m=(2.0, 5.0), projection=FacingBins(0.4))
    small = replace(large, extent_m=(1.0, 2.5), projection=FacingBins(0.2))
    track = TRACK if sensor == "lidar" else each_turned(TRACK, torch.Generator().manual_seed(0))
    start = turned_around(spoilt(poses_of(track), seed=1, degrees=3.0, metres=0.1), {1})
    done = completed(start)
    found = together(done, track.scans, large)
    halved = [SE3(item.pose.rotation, item.pose.translation / 2) for item in done]
    boxes = [carried(FittedBox(BOX.centre / 2, BOX.size / 2, BOX.rotation), T) for T in halved]
    less = [
        replace(one, points=one.points / 2, pose=pose, box=box)
        for one, pose, box in zip(done, halved, boxes)
    ]
    twin = together(less, [scan / np.float32(2) for scan in track.scans], small)
    for one, other in zip(found, twin):
        np.testing.assert_allclose(2 * other.points, one.points, atol=2e-3)
        torch.testing.assert_close(other.pose.rotation, one.pose.rotation, atol=1e-3, rtol=0)
        assert 2 * other.cost == pytest.approx(one.cost, abs=1e-3)
        assert 2 * np.asarray(other.box.size) == pytest.approx(one.box.size, abs=5e-3)


@pytest.mark.parametrize("sensor", ["lidar", "camera"])
def test_votes_do_not_depend_on_the_size_of_the_objects(sensor):
    votes = []
    for size in (1.0, 0.5):
        cell, extents = FacingBins(0.4 * size), (2.0 * size, 5.0 * size)
        settings = replace(SETTINGS, sensor=sensor, extent_m=extents, projection=cell)
        gathered = whole.Gathered(settings)
        gathered.scans = [scan * np.float32(size) for scan in TRACK.scans]
        poses, inputs = poses_of(TRACK), network_inputs(gathered.scans, settings)
        poses = SE3(poses.rotation, size * poses.translation)
        votes.append(whole._votes(poses, size * SHAPE, 0.1 * size, gathered, inputs, TrackConfig()))
    for one, other in zip(*votes):
        torch.testing.assert_close(other, one, atol=1e-3, rtol=0)
        assert float(one.abs().max()) > 0.03


def test_the_confidence_is_that_of_scans_that_were_completed():
    """A scan that was only looked at does not count, nor is the mean shape of it."""
    gathered, done = whole.Gathered(SETTINGS), completed(poses_of(TRACK))
    for i, (item, scan) in enumerate(zip(done, TRACK.scans)):
        if i == 3:
            pose = item.pose.rotation[None], item.pose.translation[None]
            said = torch.tensor([0.1]), torch.tensor([2]), torch.zeros(1, 7)
            found = Found(2 * SHAPE[None], *pose, *said)
            gathered.pass_by(Looked([scan], [scan], found), None, ReasonRule())
        else:
            gathered.add(item, scan)
    assert gathered.said[3].confidence != 0.5
    torch.testing.assert_close(gathered.shape, SHAPE[: CONFIG.points], atol=1e-5, rtol=0)
    assert gathered.rows.tolist() == [0, 1, 2, 4, 5, 6]
    found = list(whole.complete_together(gathered))
    assert [item.confidence for item in found] == pytest.approx([0.5] * 7)
    assert [item.branch for item in found] == [0, 0, 0, 2, 0, 0, 0]


def test_half_turns_are_about_the_middle_of_the_object_wherever_its_origin_lies():
    beside = torch.tensor((0.8, 0.0, 0.0), dtype=torch.float64)
    true = poses_of(TRACK) @ SE3(torch.eye(3).double(), -beside)
    back = true @ half_turn(0.8)
    start = back.where(torch.arange(7) % 4 == 1, true)
    shape = SHAPE + beside
    done = [
        replace(item, points=start[i].apply(shape).float().numpy(), pose=start[i])
        for i, item in enumerate(completed(start))
    ]
    for i, item in enumerate(together(done, TRACK.scans)):
        off = true[i].inverse() @ item.pose
        assert float(torch.rad2deg(off.angle())) < 5.0
        assert float((off.apply(beside[None]) - beside).norm()) < 0.2


def test_the_surface_seen_is_that_of_both_sides_of_a_symmetric_object():
    both, one = (
        whole._seen(list(TRACK.scans), poses_of(TRACK), mirror, TrackConfig())
        for mirror in (True, False)
    )
    walls = [(part[:, 0].abs() < 1.5) & ((part[:, 2] + 0.25).abs() < 0.2) for part in (both, one)]
    seen = [set(part[wall, 1].sign().tolist()) for part, wall in zip((both, one), walls)]
    assert seen == [{-1.0, 1.0}, {-1.0}]


def test_the_box_is_fitted_to_each_scan_where_it_lies_on_the_object(monkeypatch):
    handed, fit, true = [], whole.fit_for, poses_of(TRACK)

    def kept(settings, shape, seen, *more):
        handed.extend(seen)
        return fit(settings, shape, handed, *more)

    monkeypatch.setattr(whole, "fit_for", kept)
    whole._box(SHAPE, list(TRACK.scans), true, SETTINGS, whole.BoxConfig())
    for cloud, pose, scan in zip(handed, true, TRACK.scans, strict=True):
        expected = pose.inverse().apply(torch.from_numpy(scan).double())
        torch.testing.assert_close(cloud, expected)


def test_how_far_off_an_end_not_seen_may_be_shrinks_with_the_objects():
    """A metre was a metre, also of objects that are smaller than that."""
    config, before, lengths = BoxConfig(hidden_share=0.2), SHAPE[SHAPE[:, 0] < 0.5].numpy(), []
    for size in (1.0, 0.5):
        settings = replace(SETTINGS, extent_m=(0.0, 5.0 * size))
        box = whole._box(size * SHAPE, [size * before], SE3.identity(1), settings, config)
        lengths.append(float(box.size[0]) / size)
    assert lengths == pytest.approx([4.2] * 2, abs=0.05)  # the scan ends 1.6 m before the shape


def test_a_sensor_that_passed_by_between_two_scans_turns_none_that_is_sure_of_itself():
    """Were one of them turned around, it would have stood where it was; of neighbours one is."""
    passing, near = (drive_by(scans=2, step=step, heading=0.0, side=1.5) for step in (24.0, 2.0))
    for track, wrong, p_pose in ((passing, set(), (0.99, 0.99)), (near, {1}, (0.99, 0.6))):
        true = poses_of(track)
        stated = zip(completed(turned_around(true, wrong)), p_pose)
        own = [replace(one, p_pose=p, p_box=0.9) for one, p in stated]
        for one, pose in zip(together(own, track.scans), true):
            assert float(torch.rad2deg((pose.inverse() @ one.pose).angle())) < 10.0
