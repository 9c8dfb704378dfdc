# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A teacher's targets: made from scans alone, kept for one run, and what a run makes of them."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from tests.cars import drive_by, poses_of
from tests.strategies import rotation_about
from tests.training.self_training.taught import TAUGHT, sampler_of

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.method.checkpoint import load_checkpoint
from wildshape.training.batches.views import ViewSampler
from wildshape.training.loop import StopRequested, fit, setup
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
    view_tops,
    with_roof,
)
from wildshape.training.self_training.targets import (
    TARGETS,
    load_targets,
    save_targets,
    true_targets,
)
from wildshape.training.state import STATE, save_state

IDENTITY = {"data": "abc", "teacher": "def"}


def counts(store):
    """Of scans, and of tracks to train on."""
    return store.scan_count, len(sampler_of(store).scans_of)


@pytest.fixture(scope="module")
def targets(car_store, teacher):
    return fused_targets(teacher, sampler_of(car_store))


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
    told = fused_targets(teacher, sampler, fronts=fronts)
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
    with StoreWriter(tmp_path / "store", {}) as writer:
        for car in cars[:2]:
            writer.add(replace(car, T_sensor_object=None, shape=None))
    store = open_store(tmp_path / "store")
    with StoreWriter(tmp_path / "known", {}) as writer:
        for car in cars[:2]:
            writer.add(car)
    blind = fused_targets(teacher, sampler_of(store))
    seeing = fused_targets(teacher, sampler_of(open_store(tmp_path / "known")))
    for one, two in zip(blind, seeing):
        assert torch.equal(torch.as_tensor(one), torch.as_tensor(two))


@pytest.mark.parametrize("complete", [False, True])
def test_saved_and_loaded_are_equal(car_store, targets, tmp_path, complete):
    kept = targets._replace(complete=complete)
    save_targets(tmp_path, kept, IDENTITY)
    found = load_targets(tmp_path, IDENTITY, *counts(car_store))
    assert found is not None
    assert found.complete is complete
    for one, two in zip(found[:4], kept[:4]):
        assert torch.equal(torch.as_tensor(one), torch.as_tensor(two))


def test_targets_of_another_run_or_damaged_ones_are_made_anew(car_store, targets, tmp_path):
    known = counts(car_store)
    assert load_targets(tmp_path, IDENTITY, *known) is None
    save_targets(tmp_path, targets, IDENTITY)
    for key in IDENTITY:
        assert load_targets(tmp_path, IDENTITY | {key: "other"}, *known) is None
    save_targets(tmp_path, targets, IDENTITY | {"headings": "ghi"})
    assert load_targets(tmp_path, IDENTITY, *known) is None
    path = tmp_path / TARGETS
    path.write_bytes(path.read_bytes()[:-100])
    assert load_targets(tmp_path, IDENTITY, *known) is None
    for name in ("rotation", "translation", "shapes", "sensors"):
        for bad in (getattr(targets, name) * torch.nan, getattr(targets, name)[1:]):
            save_targets(tmp_path, targets._replace(**{name: bad}), IDENTITY)
            assert load_targets(tmp_path, IDENTITY, *known) is None


def test_true_targets_are_the_truth(car_store, cars):
    found = true_targets(sampler_of(car_store))
    assert found.complete
    start = int(car_store.track_starts[3])
    pose = cars[3].T_sensor_object
    torch.testing.assert_close(found.rotation[start + 5], pose.rotation[5].float())
    torch.testing.assert_close(found.translation[start + 5], pose.translation[5].float())
    rows = {tuple(point) for point in found.shapes[3].tolist()}
    assert rows == {tuple(point) for point in cars[3].shape.tolist()}


@pytest.mark.parametrize("missing", ["T_sensor_object", "shape"])
def test_true_targets_refuse_data_without_truth_in_one_sentence(tmp_path, missing):
    with StoreWriter(tmp_path / "store", {}) as writer:
        writer.add(drive_by(name="known", scans=3))
        writer.add(replace(drive_by(name="unknown", scans=3), **{missing: None}))
    with pytest.raises(BadInputError) as refused:
        true_targets(sampler_of(open_store(tmp_path / "store")))
    sentence = str(refused.value)
    assert "unknown" in sentence
    assert str(tmp_path) in sentence
    assert sentence.count(".\n") == 0
    assert sentence.endswith("the oracle needs both.")


@pytest.mark.parametrize("who", ["teacher", "truth"])
def test_taught_stopped_and_resumed_is_the_undisturbed_run(car_store, teacher, tmp_path, who):
    taught = teacher if who == "teacher" else "truth"

    def train(folder, *, resume=False, progress=None):
        run = setup(TAUGHT, car_store, folder, seed=3, resume=resume, teacher=taught)
        return load_file(fit(run, progress)), load_file(folder / STATE)

    def stop(step, _):
        if step >= 10:
            raise StopRequested

    expected = train(tmp_path / "whole")
    with pytest.raises(StopRequested):
        train(tmp_path / "parts", progress=stop)
    assert (tmp_path / "parts" / TARGETS).exists() == (who == "teacher")
    for found, twin in zip(train(tmp_path / "parts", resume=True), expected):
        assert set(found) == set(twin)
        assert all(torch.equal(found[key], twin[key]) for key in twin)


def test_another_teacher_is_another_run(car_store, teacher, tmp_path):
    run = setup(TAUGHT, car_store, tmp_path, seed=3, teacher=teacher)
    save_state(tmp_path, run.state, run.identity)
    with pytest.raises(BadInputError, match="teacher"):
        setup(TAUGHT, car_store, tmp_path, seed=3, teacher="truth", resume=True)


def test_a_run_with_headings_is_another_run_without(car_store, tmp_path):
    run = setup(TAUGHT, car_store, tmp_path, seed=3, teacher="truth")
    save_state(tmp_path, run.state, run.identity | {"headings": "abc"})
    with pytest.raises(BadInputError, match="other headings;"):
        setup(TAUGHT, car_store, tmp_path, seed=3, teacher="truth", resume=True)


def test_a_teacher_of_another_kind_of_sensor_is_refused(car_store, teacher):
    camera = ViewSampler(car_store, np.arange(2), replace(TAUGHT.views, sensor="camera"))
    with pytest.raises(BadInputError, match="lidar scans and cannot teach camera scans"):
        fused_targets(teacher, camera)


def test_what_is_taught_is_learned(car_store, tmp_path):
    """The oracle's loss on its own cars falls."""
    recipe = replace(TAUGHT, optim=replace(TAUGHT.optim, steps=120, lr=3e-3), validate_every=1000)
    losses = []
    fit(
        setup(recipe, car_store, tmp_path, seed=3, teacher="truth"),
        lambda _, values: losses.append(values["loss"]),
    )
    assert losses[-1] < 0.85 * losses[0]


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
    """How far the object's origin lies from where it should, metres, a scan each."""
    true = poses_of(cars[index]).translation.float()
    return (track.T_sensor_can.translation - true).norm(dim=-1)


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


def test_poses_by_which_a_scan_would_jump_are_not_taken(cars, monkeypatch):
    track = true_track(cars, 0)
    away = SE3(track.T_sensor_can.rotation, track.T_sensor_can.translation + 9.0)
    monkeypatch.setattr(pseudo_labels, "refine_by_graph", lambda *_: away)
    assert chained(list(cars[0].scans), track.T_sensor_can) is track.T_sensor_can


def test_tracks_turned_as_wholes_look_one_way_again(who, cars):
    turned = torch.tensor((1.0, -1.0, 1.0, -1.0, 1.0, 1.0))
    tracks = [true_track(cars, i, sign.expand(12)) for i, sign in enumerate(turned)]
    found = agreed_tracks(who, tracks, [sign.expand(12) for sign in turned])
    assert max(float(off(track, cars, i).max()) for i, track in enumerate(found)) < 1e-4


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


def test_a_camera_s_view_ends_above_no_track(car_store):
    camera = ViewSampler(
        car_store, np.arange(len(car_store)), replace(TAUGHT.views, sensor="camera")
    )
    assert view_tops(camera) == [math.inf] * len(car_store)


def test_targets_of_other_rules_are_made_anew(car_store, teacher, tmp_path):
    """A run with other numbers does not take the targets that lie in its folder."""
    for points in (64, 128):
        rules = replace(TAUGHT.self_training, fusion=FusionConfig(points=points))
        recipe = replace(TAUGHT, self_training=rules)
        run = setup(recipe, car_store, tmp_path, seed=3, teacher=teacher)
        assert run.targets is not None
        assert run.targets.shapes.shape[1] == points


def test_targets_of_fewer_scans_are_made_anew(cars, teacher, tmp_path):
    """A run that also reads smaller scans does not take targets in which these have no pose."""
    with StoreWriter(tmp_path / "store", {}) as writer:
        for car in cars[:2]:
            writer.add(car.part(range(3)))
    store = open_store(tmp_path / "store")
    smallest = int(np.argmin(store.scan_sizes))
    for least in (int(store.scan_sizes[smallest]) + 1, TAUGHT.views.min_points):
        recipe = replace(TAUGHT, views=replace(TAUGHT.views, min_points=least))
        run = setup(recipe, store, tmp_path, seed=3, teacher=teacher)
        assert run.targets is not None
    rotation = run.targets.rotation[smallest]
    torch.testing.assert_close(rotation @ rotation.T, torch.eye(3), atol=1e-4, rtol=0)


def test_the_rules_numbers_are_saved_with_the_run_and_its_model(car_store, tmp_path):
    rules = replace(TAUGHT.self_training, fusion=FusionConfig(points=64))
    recipe = replace(TAUGHT, self_training=rules, optim=replace(TAUGHT.optim, steps=1))
    model = fit(setup(recipe, car_store, tmp_path, seed=3, teacher="truth"))
    described = json.loads((tmp_path / "run.json").read_text("utf-8"))
    for provenance in (described, load_checkpoint(model)[1].provenance):
        assert provenance["recipe"]["self_training"]["fusion"]["points"] == 64
        assert provenance["recipe"]["self_training"]["draw"]["occlusion"]["rings"] == 0.2
