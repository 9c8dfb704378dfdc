# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A teacher's targets: made from scans alone."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.packed import packed
from tests.strategies import rotation_about
from tests.training.self_training.taught import NOT_KEPT, TAUGHT, sampler_of

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training import pseudo_labels
from wildshape.training.self_training.fused_shape import FusionConfig
from wildshape.training.self_training.headings import PosedTrack
from wildshape.training.self_training.pseudo_labels import (
    SelfTrainingConfig,
    Teacher,
    agreed_tracks,
    chained,
    fused_targets,
    heading_votes,
    levelled,
    refined,
    shape_of,
    whole_shape,
    with_roof,
)


def test_every_scan_gets_a_pose_and_every_track_a_shape(car_store, targets):
    scans = len(car_store.scan_sizes)
    assert targets.rotation.shape == (scans, 3, 3)
    assert targets.shapes.shape[0] == targets.sensors.shape[0] == len(car_store)
    assert not targets.complete
    eye = torch.eye(3).expand(scans, 3, 3)
    torch.testing.assert_close(targets.rotation @ targets.rotation.mT, eye, atol=1e-4, rtol=0)
    for part in targets[:4]:
        assert bool(torch.isfinite(part).all())


def test_targets_look_where_the_objects_are_known_to_look(car_store, teacher, targets):
    """Every second track is said to look the other way; no vote of all tracks undoes it."""
    sampler = sampler_of(car_store)
    fronts = targets.rotation[:, :, 0].clone()
    for scans in sampler.scans_of[::2]:
        fronts[torch.from_numpy(scans)] *= -1.0
    told = fused_targets(teacher, sampler, fronts=fronts, parts=NOT_KEPT)
    assert (told.rotation[:, :, 0] * fronts).sum(-1).min() > 0


def test_the_fused_shape_is_its_scans_reflected(car_store, targets):
    """Carried to the canonical frame by their targets, the scans lie on the shape; so does their
    reflection."""
    across = torch.tensor((1.0, -1.0, 1.0))
    for track in range(2):
        scan = int(car_store.track_starts[track])
        pose = SE3(targets.rotation[scan], targets.translation[scan])
        points = pose.inverse().apply(torch.from_numpy(car_store.scan_points(scan).copy()))
        for cloud in (points, points * across):
            assert float(torch.cdist(cloud, targets.shapes[track]).amin(1).median()) < 0.08


def test_targets_do_not_pitch_against_level_sensors(car_store, targets):
    """The sensors of the fixture are level; whatever the teacher's frame does."""
    starts = np.asarray(car_store.track_starts)
    ups = [targets.rotation[a:b, 2].mean(0) for a, b in itertools.pairwise(starts)]
    level = [up for up in ups if float(up.norm()) > 0.9]
    assert len(level) > len(ups) / 2
    for up in level:
        assert abs(float(up[0])) < 1e-4


def test_the_sensors_are_where_the_scans_were_taken(car_store, targets):
    first = car_store.track_starts[:-1]
    rows = torch.from_numpy(np.asarray(first))
    places = SE3(targets.rotation[rows], targets.translation[rows]).inverse().translation
    torch.testing.assert_close(targets.sensors[:, 0], places, atol=1e-4, rtol=0)


def test_targets_do_not_depend_on_truth(cars, car_store, teacher, targets, tmp_path):
    """The same scans without poses and shapes give the same targets: no label enters."""
    store = packed(
        tmp_path / "store", [replace(car, T_sensor_object=None, shape=None) for car in cars[:2]]
    )
    blind = fused_targets(teacher, sampler_of(store), parts=NOT_KEPT)
    known = packed(tmp_path / "known", cars[:2])
    seeing = fused_targets(teacher, sampler_of(known), parts=NOT_KEPT)
    for one, two in zip(blind, seeing):
        assert torch.equal(torch.as_tensor(one), torch.as_tensor(two))


def test_a_teacher_of_another_kind_of_sensor_is_refused(car_store, teacher):
    camera = ViewSampler(car_store, np.arange(2), replace(TAUGHT.views, sensor="camera"))
    with pytest.raises(BadInputError, match="lidar scans and cannot teach camera scans"):
        fused_targets(teacher, camera, parts=NOT_KEPT)


@pytest.fixture(scope="module")
def who(car_store, teacher):
    config = SelfTrainingConfig()
    views = sampler_of(car_store)
    return Teacher.of(teacher, views, config, time_ordered=True, headings=None)


def true_track(cars, index, signs=None):
    """A car as a teacher that knows the truth would pose it, some scans turned."""
    poses = poses_of(cars[index])
    count = len(poses)
    true = SE3(poses.rotation.float(), poses.translation.float())
    track = PosedTrack(np.arange(count) + index * count, true, 0.0)
    return track if signs is None else track.turned(signs)


def off(track, cars, index):
    """How far the object's front lies from where it should, metres, a scan each."""
    front = torch.tensor((2.0, 0.0, 0.0)).expand(len(track.scans), 1, 3)
    true = poses_of(cars[index]).to(torch.float32).apply(front)
    return (track.T_sensor_can.apply(front) - true)[:, 0].norm(dim=-1)


def test_a_teacher_reads_the_scans_as_it_was_trained(who, car_store):
    assert who.asked.config.points == who.settings.input_points
    assert who.asked.config.turn == "none"
    assert who.views.config.turn == "facing"
    assert [list(scans) for scans in who.asked.scans_of] == [
        list(scans) for scans in who.views.scans_of
    ]
    (cloud, *_) = who.clouds(PosedTrack(np.array([5]), SE3.identity(1), 0.0))
    np.testing.assert_allclose(cloud * who.unit, car_store.scan_points(5), rtol=1e-6)


def test_the_scans_of_a_track_that_are_turned_are_named(who, cars):
    turned = torch.where(torch.arange(12) % 4 == 1, -1.0, 1.0)
    votes = heading_votes(who, true_track(cars, 1, turned))
    assert torch.equal(votes, turned) or torch.equal(votes, -turned)


def test_refined_scans_lie_nearer_to_each_other(who, cars):
    """Each shaken by itself; what all have in common stays unknown, so neighbours are compared."""
    track, true = true_track(cars, 0), poses_of(cars[0]).to(torch.float32)
    shake = 0.2 * torch.randn(12, 3, generator=torch.Generator().manual_seed(0))
    shaken = SE3(track.T_sensor_can.rotation, track.T_sensor_can.translation + shake)
    shaken = track._replace(T_sensor_can=shaken)

    def apart(poses):
        own = true.inverse() @ poses
        return float((own[1:] @ own[:-1].inverse()).translation.norm(dim=-1).mean())

    assert apart(refined(who, shaken).T_sensor_can) < 0.5 * apart(shaken.T_sensor_can)


def nothing_moves(monkeypatch, by_graph=0.0):
    """Fits that leave all poses as they are, or move them all by so much."""

    def moved(_scans, poses, *_):
        return SE3(poses.rotation, poses.translation + by_graph)

    monkeypatch.setattr(pseudo_labels, "refine_jointly", lambda _, poses, **__: poses)
    monkeypatch.setattr(pseudo_labels, "refine_by_graph", moved)


def test_a_scan_gone_astray_is_put_back_where_scans_follow_each_other(who, cars, monkeypatch):
    nothing_moves(monkeypatch)
    track, quarter = true_track(cars, 0), rotation_about((0, 0, 1), math.pi / 2).float()
    rotation = track.T_sensor_can.rotation.clone()
    rotation[4] = rotation[4] @ quarter
    astray = track._replace(T_sensor_can=SE3(rotation, track.T_sensor_can.translation))
    back = refined(who, astray).T_sensor_can
    own = track.T_sensor_can.inverse() @ back
    assert float(torch.rad2deg(own.angle()).max()) < 15
    unordered = refined(replace(who, time_ordered=False), astray).T_sensor_can
    torch.testing.assert_close(unordered.matrix, astray.T_sensor_can.matrix)


def test_neighbours_are_laid_on_each_other_in_time_order_in_units(who, cars, monkeypatch):
    """Of objects half as large, a tenth of a unit is half as many metres."""
    nothing_moves(monkeypatch, by_graph=0.1)
    half = replace(who, settings=replace(who.settings, extent_m=(1.0, 2.5)))
    assert half.unit == 0.5
    track = true_track(cars, 0)
    for teacher, way in ((half, 0.05), (replace(half, time_ordered=False), 0.0)):
        found = refined(teacher, track).T_sensor_can.translation - track.T_sensor_can.translation
        torch.testing.assert_close(found, torch.full((12, 3), way), atol=1e-5, rtol=0)


def test_poses_by_which_a_scan_would_jump_are_not_taken(cars, monkeypatch):
    track = true_track(cars, 0)
    away = SE3(track.T_sensor_can.rotation, track.T_sensor_can.translation + 9.0)
    monkeypatch.setattr(pseudo_labels, "refine_by_graph", lambda *_: away)
    assert chained(list(cars[0].scans), track.T_sensor_can) is track.T_sensor_can


def test_tracks_turned_as_wholes_look_one_way_again(who, cars):
    turned = torch.tensor((1.0, -1.0, 1.0, -1.0, 1.0, 1.0))
    tracks = [true_track(cars, i, sign.expand(12)) for i, sign in enumerate(turned)]
    shapes = [shape_of(who, track) for track in tracks]
    found = agreed_tracks(shapes, tracks, [sign.expand(12) for sign in turned])
    assert max(float(off(track, cars, i).max()) for i, track in enumerate(found)) < 1e-4


def test_a_teacher_that_is_clear_about_a_track_is_believed_against_its_profile(who, cars):
    """The shape of one looks turned; the teacher posed all its scans as they are."""
    tracks = [true_track(cars, i) for i in range(6)]
    shapes = [shape_of(who, track) for track in tracks]
    shapes[0] = shapes[0] * np.array((-1, -1, 1), np.float32)
    found = agreed_tracks(shapes, tracks, [torch.ones(12)] * 6)
    assert max(float(off(track, cars, i).max()) for i, track in enumerate(found)) < 1e-4


def test_lengths_shrink_with_the_objects(who, cars, monkeypatch):
    """Of objects half as large: voxels of their shape, and what is asked of other weights."""
    settings = replace(who.settings, extent_m=(1.0, 2.5))
    half = replace(who, settings=settings, headings=load(raw=True))
    voxels, asked = [], []

    def fused(*_, voxel_m, **__):
        voxels.append(voxel_m)
        return np.zeros((1, 3), np.float32)

    def signs(_other, scans, poses, _config):
        asked.append((scans[0], poses.translation))
        return torch.ones(len(scans))

    monkeypatch.setattr(pseudo_labels, "fused_shape", fused)
    monkeypatch.setattr(pseudo_labels, "transferred_signs", signs)
    track = true_track(cars, 0)
    shape_of(half, track)
    heading_votes(half, track)
    assert voxels == [pytest.approx(0.5 * FusionConfig().lidar_voxel_m)]
    np.testing.assert_allclose(asked[0][0], 2 * cars[0].scans[0], rtol=1e-6)
    torch.testing.assert_close(asked[0][1], 2 * track.T_sensor_can.translation)


def test_a_pitched_frame_is_levelled(cars):
    pitch = rotation_about((0, 1, 0), 0.1).float()
    track = true_track(cars, 0)
    pitched = SE3(track.T_sensor_can.rotation @ pitch, track.T_sensor_can.translation)
    up = levelled(track._replace(T_sensor_can=pitched)).T_sensor_can.rotation[:, 2].mean(0)
    assert abs(float(up[0])) < 1e-4


def test_the_rules_numbers_can_be_set(who, cars):
    fewer = replace(who.config, fusion=FusionConfig(points=300, lidar_voxel_m=0.3))
    few = shape_of(replace(who, config=fewer), true_track(cars, 0))
    assert few.shape == (300, 3)
    assert len(np.unique(few, axis=0)) < len(np.unique(shape_of(who, true_track(cars, 0)), axis=0))


def test_a_roof_above_all_sensors_takes_no_points_away(who):
    """Walls of 3 m before sensors at 1.7 m: as many points as before, some between the walls."""
    x, z = np.meshgrid(np.arange(-4, 4.05, 0.1), np.arange(0, 3, 0.1), indexing="ij")
    walls = [np.stack((x, np.full_like(x, y), z), -1).reshape(-1, 3) for y in (-1.0, 1.0)]
    shape = np.concatenate(walls).astype(np.float32)
    place = torch.tensor((0.0, -10.0, -1.7)).expand(3, 3)
    track = PosedTrack(np.arange(3), SE3(torch.eye(3).expand(3, 3, 3), -place), 0.0)
    closed = with_roof(who, shape, track, math.inf)
    assert closed.shape == shape.shape
    assert np.abs(closed[:, 1]).min() < 0.5


def test_a_lidar_s_view_ends_where_its_scans_tell_and_so_does_the_roof(who, cars, monkeypatch):
    asked, tops = [], []

    def ends(slopes):
        asked.extend(slopes)
        return 0.05

    def closed(_who, shape, _track, top):
        tops.append(top)
        return 2 * shape

    monkeypatch.setattr(pseudo_labels, "view_top", ends)
    monkeypatch.setattr(pseudo_labels, "with_roof", closed)
    track = true_track(cars, 1)
    shape, top = whole_shape(who, track)
    assert (top, tops) == (0.05, [0.05])
    assert np.array_equal(shape, 2 * shape_of(who, track))
    steepest = [float((s[:, 2] / np.hypot(s[:, 0], s[:, 1])).max()) for s in cars[1].scans]
    assert asked == pytest.approx(steepest, abs=1e-5)


def test_a_camera_s_view_ends_above_no_track(who, cars):
    camera = replace(who, settings=replace(who.settings, sensor="camera"))
    shape, top = whole_shape(camera, true_track(cars, 0))
    assert top == math.inf
    assert np.array_equal(shape, shape_of(camera, true_track(cars, 0)))
