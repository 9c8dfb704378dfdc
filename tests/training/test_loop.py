# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Repeatable, resumable, and it stops before it spoils anything."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from tests.refusal import refused
from tests.training.worker import SMALLEST

from wildshape.errors import BadInputError
from wildshape.method.checkpoint import MODEL, load_checkpoint
from wildshape.method.ray_encoder import RayConfig
from wildshape.training import loop
from wildshape.training.loop import StopRequested, fit, setup
from wildshape.training.state import STATE
from wildshape.training.validate import Validation


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


@pytest.mark.parametrize(("step", "kept"), [(25, 25), (50, 50), (75, 60)])
def test_stopped_and_resumed_is_the_undisturbed_run(car_store, undisturbed, tmp_path, step, kept):
    with pytest.raises(StopRequested):
        trained(car_store, tmp_path, progress=stop_at(step, StopRequested()))
    with safe_open(tmp_path / STATE, framework="pt") as file:
        assert file.metadata()["step"] == str(kept)
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


def test_the_optimiser_is_adam_as_it_comes_and_without_a_mean_the_last_weights_are_kept(
    car_store, tmp_path
):
    plain = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=3, average=0.0))
    state = trained(car_store, tmp_path, recipe=plain).state
    usual = torch.optim.Adam([torch.zeros(1)]).defaults
    for name in ("betas", "eps", "weight_decay", "amsgrad"):
        assert state.optimiser.defaults[name] == usual[name]
    kept, last = load_file(tmp_path / MODEL), state.network.state_dict()
    assert all(torch.equal(kept[name], weights) for name, weights in last.items())


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
        ("adam.0.exp_avg", lambda t: t + 1e-6),
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
    with pytest.raises(BadInputError, match=r"state\.safetensors: .*(fit|no numbers|checksum)"):
        setup(SMALLEST, car_store, tmp_path, seed=3, resume=True)


def test_resume_refuses_a_step_that_was_changed_and_takes_states_without_a_checksum(
    car_store, undisturbed, tmp_path
):
    with safe_open(undisturbed / STATE, framework="pt") as file:
        metadata = file.metadata()
    path, tensors = tmp_path / STATE, load_file(undisturbed / STATE)
    save_file(tensors, path, metadata | {"step": "15"})
    with pytest.raises(BadInputError, match="checksum is wrong"):
        setup(SMALLEST, car_store, tmp_path, seed=3, resume=True)
    del metadata["sha256"]  # as older versions wrote them
    save_file(tensors, path, metadata)
    assert setup(SMALLEST, car_store, tmp_path, seed=3, resume=True).state.step == 75


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


def test_the_checkpoint_says_how_scans_are_to_be_read_and_what_was_validated(
    car_store, tmp_path, monkeypatch
):
    views, loss = replace(SMALLEST.views, turn="facing"), replace(SMALLEST.loss, belief=0.04)
    run = setup(replace(SMALLEST, views=views, loss=loss), car_store, tmp_path)
    asked = []

    def truth(network, _settings, _store, tracks, turn, _config):
        asked.append((network is run.state.mean, tracks is run.held_tracks, turn))
        return {"truth_cd": 0.5}

    monkeypatch.setattr(loop, "validate", lambda *_: Validation(0.1, 0.2, 0.3, 0.4, 5.0))
    monkeypatch.setattr(loop, "usual_up", lambda *_: (0.0, 0.0, 1.0))
    monkeypatch.setattr(loop, "truth_figures", truth)
    logged = loop.checkpoint(run)
    _, settings = load_checkpoint(tmp_path / MODEL)
    assert (settings.facing, settings.belief, settings.up) == (True, 0.04, (0.0, 0.0, 1.0))
    assert settings.cost_m == (0.3, 0.4)
    assert settings.metrics == {
        "observation": 0.1,
        "projection": 0.2,
        "cost_median": 0.3,
        "cost_p90": 0.4,
        "cycle_deg": 5.0,
        "truth_cd": 0.5,
    }
    assert logged == {f"validation/{name}": value for name, value in settings.metrics.items()}
    assert asked == [(True, True, "yaw")]


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


def test_headings_are_agreed_on_at_their_shares_of_the_run_by_the_mean_weights(
    car_store, tmp_path, monkeypatch
):
    """From then on scans are held to them, also in a run that is resumed."""
    asked = []

    def agreed(network, sampler, *_):
        asked.append((run.state.step, network is run.state.mean))
        return torch.full((len(sampler.store.scan_sizes), 3, 3), float(len(asked)))

    def checkpoint(run):
        loop.save_state(run.folder, run.state, run.identity)
        return {}

    monkeypatch.setattr(loop, "agreed_rotations", agreed)
    monkeypatch.setattr(loop, "checkpoint", checkpoint)
    optim, loss = replace(SMALLEST.optim, steps=6), replace(SMALLEST.loss, agree_at=(0.34, 0.67))
    recipe = replace(SMALLEST, optim=optim, loss=loss)
    run = setup(recipe, car_store, tmp_path, seed=3)
    fit(run)
    assert asked == [(2, True), (4, True)]
    again = setup(recipe, car_store, tmp_path, seed=3, resume=True)
    for one in (run, again):
        assert bool((one.sampler.draw(0).anchor == 2.0).all())


@pytest.mark.parametrize("every", [10, 30])
def test_a_loss_that_is_not_finite_stops_and_spoils_no_checkpoint(car_store, tmp_path, every):
    recipe = replace(SMALLEST, validate_every=every)
    with pytest.raises(StopRequested):
        trained(car_store, tmp_path, recipe=recipe, progress=stop_at(10, StopRequested()))
    run = setup(recipe, car_store, tmp_path, seed=3, resume=True)
    before = (tmp_path / STATE).read_bytes()
    with torch.no_grad():
        run.state.network.shape.layer3.bias[0] = math.inf
    refused(fit, run, match="the loss is not finite; check the data")
    assert (tmp_path / STATE).read_bytes() == before


def test_weights_that_are_not_finite_are_not_saved(car_store, tmp_path):
    """The last step's loss was finite, its update was not."""
    recipe = replace(SMALLEST, optim=replace(SMALLEST.optim, steps=1, lr=math.inf))
    refused(trained, car_store, tmp_path, recipe=recipe, match="not finite")
    assert not (tmp_path / STATE).exists()
    assert not (tmp_path / "model.safetensors").exists()


def test_weights_of_which_no_loss_tells_are_not_saved(car_store, tmp_path):
    """A point of the shape that lies nowhere is no scan point's nearest."""
    run = setup(SMALLEST, car_store, tmp_path, seed=3)
    run.state.step = SMALLEST.optim.steps
    for network in (run.state.network, run.state.mean):
        network.shape.layer3.bias.data[0] = math.nan
    refused(fit, run, match="not finite")
    assert not (tmp_path / MODEL).exists()


def test_a_stop_keeps_the_last_state_that_can_be_resumed(car_store, tmp_path):
    run = setup(SMALLEST, car_store, tmp_path, seed=3)

    def spoil(step, _):
        if step > 30:
            with torch.no_grad():
                next(run.state.network.parameters()).fill_(math.nan)
            raise StopRequested

    refused(fit, run, spoil, match="not finite")
    assert setup(SMALLEST, car_store, tmp_path, seed=3, resume=True).state.step == 30


def test_several_processes_are_asked_to_stop_where_all_of_them_ask(
    car_store, tmp_path, monkeypatch
):
    """At the same steps, or one would wait for the others for ever."""
    run = setup(SMALLEST, car_store, tmp_path)
    asked = []

    def together(flag):
        asked.append(run.state.step)
        return True

    two = SimpleNamespace(count=2, device=torch.device("cpu"), any=together)
    monkeypatch.setattr(run, "processes", two)
    stops = []
    for run.state.step in range(1, 76):
        stops.append(loop._stop_asked(run, lambda: False))
    assert asked == [25, 50, 75]
    assert [step for step, stop in enumerate(stops, start=1) if stop] == asked


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
