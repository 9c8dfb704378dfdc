# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Targets belong to one run: kept, resumed, and made anew where anything else is asked for."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from tests.cars import drive_by, shape_of
from tests.packed import packed
from tests.training.self_training.taught import TAUGHT, sampler_of
from tests.training.worker import FEW_STEPS

from wildshape.errors import BadInputError
from wildshape.io.store.store import open_store
from wildshape.method.checkpoint import load_checkpoint
from wildshape.training import setup as runs
from wildshape.training.loop import StopRequested, fit, setup
from wildshape.training.runtime.torchrun import Processes
from wildshape.training.self_training.fused_shape import FusionConfig
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
    save_targets(tmp_path, targets, IDENTITY)
    whole = path.read_bytes()
    for damaged in (whole[:-100], whole[:-100] + bytes([whole[-100] ^ 1]) + whole[-99:]):
        path.write_bytes(damaged)
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


def test_a_partial_shape_is_taught_with_its_reflection(tmp_path):
    car = drive_by(scans=3)
    seen = shape_of(car)[shape_of(car)[:, 1] > 0.2]
    store = packed(tmp_path / "store", [replace(car, shape=seen, shape_kind="partial")])
    found = true_targets(sampler_of(store))
    assert found.complete
    across = found.shapes[0, :, 1]
    assert across.min() == pytest.approx(-seen[:, 1].max(), abs=0.05)
    assert across.max() == pytest.approx(seen[:, 1].max(), abs=0.05)


@pytest.mark.parametrize("missing", ["T_sensor_object", "shape"])
def test_true_targets_refuse_data_without_truth_in_one_sentence(tmp_path, missing):
    packed(
        tmp_path / "store",
        [
            drive_by(name="known", scans=3),
            replace(drive_by(name="unknown", scans=3), **{missing: None}),
        ],
    )
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


def test_another_start_is_another_run(car_store, teacher, tmp_path):
    plain = replace(FEW_STEPS, optim=replace(FEW_STEPS.optim, steps=3))
    run = setup(plain, car_store, tmp_path, seed=3, start=teacher)
    save_state(tmp_path, run.state, run.identity)
    assert setup(plain, car_store, tmp_path, seed=3, start=teacher, resume=True).state.step == 0
    with pytest.raises(BadInputError, match="other start;"):
        setup(plain, car_store, tmp_path, seed=3, resume=True)


def test_a_run_with_headings_is_another_run_without(car_store, tmp_path):
    run = setup(TAUGHT, car_store, tmp_path, seed=3, teacher="truth")
    save_state(tmp_path, run.state, run.identity | {"headings": "abc"})
    with pytest.raises(BadInputError, match="other headings;"):
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


def test_of_several_processes_one_makes_the_targets(car_store, teacher, tmp_path, monkeypatch):
    waited, fused = [], runs.fused_targets

    def leader_is_done(_):
        waited.append(True)
        monkeypatch.setattr(runs, "join", lambda _: Processes(0, 2, cpu, 0))
        monkeypatch.setattr(runs, "fused_targets", fused)
        setup(TAUGHT, car_store, tmp_path, teacher=teacher)

    def refuse(*_, **__):
        raise AssertionError("made twice")

    cpu = torch.device("cpu")
    monkeypatch.setattr(runs.time, "sleep", leader_is_done)
    monkeypatch.setattr(runs, "fused_targets", refuse)
    monkeypatch.setattr(runs, "join", lambda _: Processes(1, 2, cpu, 1))
    assert setup(TAUGHT, car_store, tmp_path, teacher=teacher).targets is not None
    assert waited == [True]


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
    store = packed(tmp_path / "store", [car.part(range(3)) for car in cars[:2]])
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
