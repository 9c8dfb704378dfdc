# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A teacher's targets: made from scans alone, kept for one run, and what a run makes of them."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from tests.cars import drive_by
from tests.training.self_training.taught import TAUGHT, sampler_of

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.training.loop import StopRequested, fit, setup
from wildshape.training.self_training.pseudo_labels import (
    fused_targets,
    true_targets,
)
from wildshape.training.self_training.saved_targets import TARGETS, load_targets, save_targets
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


def test_what_is_taught_is_learned(car_store, tmp_path):
    """The oracle's loss on its own cars falls."""
    recipe = replace(TAUGHT, optim=replace(TAUGHT.optim, steps=120, lr=3e-3), validate_every=1000)
    losses = []
    fit(
        setup(recipe, car_store, tmp_path, seed=3, teacher="truth"),
        lambda _, values: losses.append(values["loss"]),
    )
    assert losses[-1] < 0.85 * losses[0]
