# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Repeatable, resumable, and it stops before it spoils anything."""

import json
import math
from dataclasses import replace

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from tests.training.worker import SMALLEST

from wildshape.errors import BadInputError
from wildshape.io.store.store import StoreWriter, open_store
from wildshape.method.checkpoint import MODEL, load_checkpoint
from wildshape.method.ray_encoder import RayConfig
from wildshape.training.loop import StopRequested, fit, setup, split_tracks
from wildshape.training.state import STATE


class KilledError(Exception):
    """Stands for SIGKILL: nothing is saved on the way out."""


def stop_at(step, error):
    def progress(now, values):
        if now >= step:
            raise error

    return progress


def trained(store, folder, *, seed=3, recipe=SMALLEST, resume=False, progress=None):
    run = setup(recipe, store, folder, seed=seed, resume=resume)
    fit(run, progress)
    return run


@pytest.fixture(scope="module")
def undisturbed(car_store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    trained(car_store, folder)
    return folder


def log(folder):
    return [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]


def assert_same_run(folder, twin):
    for name in ("model.safetensors", STATE):
        found, expected = load_file(folder / name), load_file(twin / name)
        assert set(found) == set(expected)
        for key, tensor in expected.items():
            assert torch.equal(found[key], tensor), key
    assert sorted({e["step"] for e in log(folder)}) == sorted({e["step"] for e in log(twin)})


def test_the_same_seed_gives_the_same_weights(car_store, undisturbed, tmp_path):
    trained(car_store, tmp_path)
    assert_same_run(tmp_path, undisturbed)


def test_another_seed_gives_other_weights(car_store, undisturbed, tmp_path):
    trained(car_store, tmp_path, seed=4)
    found = load_file(tmp_path / "model.safetensors")
    expected = load_file(undisturbed / "model.safetensors")
    assert any(not torch.equal(found[k], expected[k]) for k in expected)


@pytest.mark.parametrize("step", [25, 50])
def test_stopped_and_resumed_is_the_undisturbed_run(car_store, undisturbed, tmp_path, step):
    with pytest.raises(StopRequested):
        trained(car_store, tmp_path, progress=stop_at(step, StopRequested()))
    with safe_open(tmp_path / STATE, framework="pt") as file:
        assert file.metadata()["step"] == str(step)
    trained(car_store, tmp_path, resume=True)
    assert_same_run(tmp_path, undisturbed)


def test_killed_and_resumed_is_the_undisturbed_run(car_store, undisturbed, tmp_path):
    """Killed at step 50, after the checkpoint of step 30: the 20 steps in between are redone."""
    with pytest.raises(KilledError):
        trained(car_store, tmp_path, progress=stop_at(50, KilledError()))
    with safe_open(tmp_path / STATE, framework="pt") as file:
        assert file.metadata()["step"] == "30"
    trained(car_store, tmp_path, resume=True)
    assert_same_run(tmp_path, undisturbed)


def test_killed_before_the_first_checkpoint_starts_anew(car_store, undisturbed, tmp_path):
    with pytest.raises(KilledError):
        trained(car_store, tmp_path, progress=stop_at(25, KilledError()))
    assert not (tmp_path / STATE).exists()
    trained(car_store, tmp_path, resume=True)
    assert_same_run(tmp_path, undisturbed)


def test_resuming_a_finished_run_changes_nothing(car_store, undisturbed, tmp_path):
    trained(car_store, tmp_path)
    told = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    run = setup(SMALLEST, car_store, tmp_path, seed=3, resume=True, provenance={"data": "moved"})
    fit(run)
    assert run.state.step == SMALLEST.optim.steps
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.is_file()} == told
    for name in ("model.safetensors", STATE):
        found, expected = load_file(tmp_path / name), load_file(undisturbed / name)
        assert all(torch.equal(found[k], expected[k]) for k in expected)


def test_resume_refuses_another_seed_or_other_settings(car_store, undisturbed):
    with pytest.raises(BadInputError, match=r"other seed; resume with the same settings"):
        setup(SMALLEST, car_store, undisturbed, seed=4, resume=True)
    other = replace(SMALLEST, loss=replace(SMALLEST.loss, beta=0.3))
    with pytest.raises(BadInputError, match="other settings and seed"):
        setup(other, car_store, undisturbed, seed=4, resume=True)


@pytest.mark.parametrize("content", ["foreign", "garbage", "truncated"])
def test_resume_refuses_what_is_no_state(car_store, undisturbed, tmp_path, content):
    path = tmp_path / STATE
    if content == "foreign":
        save_file({"weight": torch.zeros(2)}, path)
    else:
        whole = (undisturbed / STATE).read_bytes()
        path.write_bytes(b"no state" if content == "garbage" else whole[: len(whole) // 2])
    with pytest.raises(BadInputError, match=r"state\.safetensors: cannot be resumed from"):
        setup(SMALLEST, car_store, tmp_path, seed=3, resume=True)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("network.shape.layer1.bias", lambda t: t * math.nan),
        ("mean.shape.layer1.bias", lambda t: t[1:]),
        ("adam.0.exp_avg", lambda t: t[None]),
        ("adam.0.exp_avg_sq", lambda t: t / 0),
        ("adam.3.step", lambda _: None),
        ("adam.99.step", lambda _: torch.zeros(())),
        ("anchors", lambda _: torch.zeros(2, 3, 3)),
        ("network.pose.bias2", lambda t: t.int()),
    ],
)
def test_resume_refuses_a_state_that_does_not_fit(car_store, undisturbed, tmp_path, name, change):
    with safe_open(undisturbed / STATE, framework="pt") as file:
        metadata = file.metadata()
    tensors = load_file(undisturbed / STATE)
    changed = change(tensors.pop(name, None))
    save_file(
        tensors if changed is None else {**tensors, name: changed}, tmp_path / STATE, metadata
    )
    with pytest.raises(BadInputError, match=r"state\.safetensors: .*(fit|no numbers)"):
        setup(SMALLEST, car_store, tmp_path, seed=3, resume=True)


def test_the_checkpoint_says_what_it_is(undisturbed):
    _, settings = load_checkpoint(undisturbed / "model.safetensors")
    assert settings.network == SMALLEST.network
    assert (settings.input_points, settings.beta) == (48, SMALLEST.loss.beta)
    assert (settings.provenance["steps"], settings.provenance["seed"]) == (75, 3)
    assert settings.provenance["recipe"]["name"] == "smallest"
    assert 0 < settings.cost_m[0] <= settings.cost_m[1] < math.inf
    assert 0.5 < settings.extent_m[0] < settings.extent_m[1] < 20
    assert set(settings.metrics) >= {"observation", "projection", "cycle_deg"}
    json.dumps(settings.provenance, allow_nan=False)


def test_the_kept_weights_are_the_running_mean(car_store, tmp_path):
    """One step: the mean lies between the start and the weights after it."""
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=1, average=0.9))
    run = setup(recipe, car_store, tmp_path, seed=3)
    start = run.state.network.shape.layer3.bias.detach().clone()
    fit(run)
    now, mean = run.state.network.shape.layer3.bias, run.state.mean.shape.layer3.bias
    torch.testing.assert_close(mean, torch.lerp(start, now, 0.9), atol=1e-7, rtol=0)
    saved = load_file(tmp_path / "model.safetensors")["shape.layer3.bias"]
    assert torch.equal(saved, mean)


def test_without_averaging_the_last_weights_are_kept(car_store, tmp_path):
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=3, average=0.0))
    run = trained(car_store, tmp_path, recipe=recipe)
    for mean, now in zip(run.state.mean.parameters(), run.state.network.parameters()):
        assert torch.equal(mean, now)


@pytest.mark.parametrize("every", [10, 30])
def test_a_loss_that_is_not_finite_stops_and_spoils_no_checkpoint(car_store, tmp_path, every):
    recipe = replace(SMALLEST, validate_every=every)
    with pytest.raises(StopRequested):
        trained(car_store, tmp_path, recipe=recipe, progress=stop_at(10, StopRequested()))
    run = setup(recipe, car_store, tmp_path, seed=3, resume=True)
    before = (tmp_path / STATE).read_bytes()
    with torch.no_grad():
        run.state.network.shape.layer3.bias[0] = math.inf
    with pytest.raises(BadInputError, match="the loss is not finite; check the data"):
        fit(run)
    assert (tmp_path / STATE).read_bytes() == before


def test_weights_that_are_not_finite_are_not_saved(car_store, tmp_path):
    """The last step's loss was finite, its update was not."""
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=1, lr=math.inf))
    with pytest.raises(BadInputError, match="not finite"):
        trained(car_store, tmp_path, recipe=recipe)
    assert not (tmp_path / STATE).exists()
    assert not (tmp_path / "model.safetensors").exists()


def test_a_stop_keeps_the_last_state_that_can_be_resumed(car_store, tmp_path):
    run = setup(SMALLEST, car_store, tmp_path, seed=3)

    def spoil(step, _):
        if step > 30:
            with torch.no_grad():
                next(run.state.network.parameters()).fill_(math.nan)
            raise StopRequested

    with pytest.raises(BadInputError, match="not finite"):
        fit(run, spoil)
    assert setup(SMALLEST, car_store, tmp_path, seed=3, resume=True).state.step == 30


def test_tracks_held_out_without_a_usable_scan_are_those_fitted(cars, tmp_path):
    held = split_tracks(20)[1]
    with StoreWriter(tmp_path / "store", {}) as writer:
        for number in range(20):
            track = replace(cars[number % len(cars)], name=f"{number}")
            few = tuple(scan[:20] for scan in track.scans)
            writer.add(replace(track, scans=few) if number in held else track)
    recipe = replace(SMALLEST, held_out=20)
    run = setup(recipe, open_store(tmp_path / "store"), tmp_path / "run")
    assert sorted(run.held_tracks) == [i for i in range(20) if i not in held]


def test_few_tracks_are_both_fitted_and_held_out_many_are_not():
    fitted, held = split_tracks(8)
    assert sorted(fitted) == sorted(held) == list(range(8))
    fitted, held = split_tracks(100)
    assert len(held) == 5
    assert sorted([*fitted, *held]) == list(range(100))
    assert list(split_tracks(100)[1]) == list(held)


def test_a_network_that_sees_rays_starts_from_one_that_does_not(car_store, undisturbed, tmp_path):
    first = undisturbed / MODEL
    seeing = replace(SMALLEST, network=replace(SMALLEST.network, rays=RayConfig(count=8)))
    started = setup(seeing, car_store, tmp_path / "second", start=first).state.network
    before, _ = load_checkpoint(first)
    for name, weights in before.state_dict().items():
        assert torch.equal(started.state_dict()[name], weights)
    assert not started.rays.change.weight.any()
    assert started.rays.layer1.weight.any()


def test_fine_tuning_starts_from_the_checkpoint_and_refuses_another_size(car_store, tmp_path):
    trained(car_store, tmp_path / "first", recipe=SMALLEST)
    first = tmp_path / "first" / "model.safetensors"
    run = setup(SMALLEST, car_store, tmp_path / "second", start=first)
    saved, _ = load_checkpoint(first)
    for name, value in run.state.network.state_dict().items():
        assert torch.equal(value, saved.state_dict()[name])
    wider = replace(SMALLEST, network=replace(SMALLEST.network, points=128))
    with pytest.raises(BadInputError, match="choose the preset it was trained with"):
        setup(wider, car_store, tmp_path / "third", start=first)
