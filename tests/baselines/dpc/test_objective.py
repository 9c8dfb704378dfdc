# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC is trained from a store to a checkpoint, for a camera and for a LiDAR."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from tests.packed import packed
from tests.refusal import refused

from wildshape.baselines.dpc.completer import Dpc, load
from wildshape.baselines.dpc.network import DpcNet
from wildshape.baselines.dpc.objective import PRESETS, DpcObjective
from wildshape.baselines.dpc.run import fit_dpc, setup_dpc
from wildshape.baselines.dpc.silhouette import Hindsight
from wildshape.baselines.dpc.viewing_volume import PolarVolume
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_angle
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.batches.views import ViewSampler
from wildshape.training.loop import MODEL, StopRequested
from wildshape.training.options import TrainingOptions


def tiny(name, steps=3):
    """A preset at toy sizes."""
    base = PRESETS[name]
    network = replace(base.network, image=16, voxels=16, points=100, channels=4, code=32)
    views = replace(base.views, tracks=2, views=3, points=200, min_points=16)
    optim = replace(base.optim, steps=steps, lr=2e-3, decay_every=0)
    return replace(base, network=network, views=views, optim=optim)


@pytest.fixture(scope="module")
def planes():
    config = SimulationConfig(tracks=2, scans=4, sensor="depth-camera", category="airplane")
    return list(simulate_tracks(config, seed=0, workers=1))


@pytest.fixture(scope="module")
def plane_store(planes, tmp_path_factory):
    path = tmp_path_factory.mktemp("planes") / "store"
    return packed(path, planes)


def test_the_presets_hold_the_authors_numbers():
    recipe = PRESETS["dpc"]
    network, loss = recipe.network, recipe.loss
    assert (network.points, network.voxels, network.image, network.candidates) == (8000, 64, 128, 4)
    assert (loss.sigma, loss.keep, loss.student, loss.depth) == ((3.0, 0.2), (0.07, 1.0), 20.0, 0.0)
    assert (recipe.optim.steps, recipe.optim.lr) == (600_000, 1e-4)
    assert not loss.half_turn
    assert (network.reach, PRESETS["dpc-dagger"].network.reach) == (0.0, 0.15)
    lidar = PRESETS["dpc-lidar"].network
    assert (lidar.volume, lidar.image) == (PolarVolume(6.0), 128)


@pytest.mark.parametrize("name", ["dpc-small", "dpc-dagger-small", "dpc-lidar-small"])
def test_every_part_is_taught(name, plane_store, car_store):
    recipe = tiny(name)
    recipe = replace(recipe, loss=replace(recipe.loss, depth=1.0))
    store = car_store if "lidar" in name else plane_store
    batch = ViewSampler(store, np.arange(2), recipe.views).draw(0)
    torch.manual_seed(0)
    network = DpcNet(recipe.network)
    result = DpcObjective(network, recipe.loss)(batch, 0.0, torch.Generator().manual_seed(0))
    result.loss.backward()
    won = set(result.winner.tolist()) | {network.config.candidates}
    for weight, p in network.named_parameters():
        branch = weight.split(".")[1]
        if weight.startswith("branches") and int(branch) not in won:
            continue
        assert p.grad is not None, weight
        assert p.grad.isfinite().all(), weight
        assert p.grad.abs().sum() > 0, weight


def test_a_half_turn_that_wins_teaches_a_candidate_too(plane_store, monkeypatch):
    recipe = tiny("dpc-small")
    loss = replace(recipe.loss, half_turn=True)
    batch = ViewSampler(plane_store, np.arange(2), recipe.views).draw(0)
    torch.manual_seed(0)
    network = DpcNet(recipe.network)

    def last_wins(posed, *others):
        zero = posed.sum() * 0
        return Hindsight(zero, zero, zero, torch.full((len(posed),), posed.shape[1] - 1))

    monkeypatch.setattr("wildshape.baselines.dpc.objective.hindsight", last_wins)
    result = DpcObjective(network, loss)(batch, 0.0, torch.Generator().manual_seed(0))
    result.loss.backward()
    taught = {
        int(weight.split(".")[1])
        for weight, p in network.named_parameters()
        if weight.startswith("branches") and p.grad is not None and p.grad.abs().sum() > 0
    }
    student = network.config.candidates
    assert result.winner.tolist() == [student] * 6
    assert student in taught
    assert len(taught) > 1


def test_training_lowers_the_loss_and_can_be_resumed(plane_store, tmp_path):
    seen = []
    whole = setup_dpc(tiny("dpc-small", 27), plane_store, tmp_path / "whole")
    fit_dpc(whole, lambda _, values: seen.append(values["silhouette"]))
    assert seen[-1] < seen[0]
    part = setup_dpc(tiny("dpc-small", 27), plane_store, tmp_path / "part")
    with pytest.raises(StopRequested):
        fit_dpc(part, stopped=lambda: part.state.step == 9)
    again = setup_dpc(tiny("dpc-small", 27), plane_store, tmp_path / "part", resume=True)
    assert again.state.step == 9
    fit_dpc(again)
    expected, found = (load_file(tmp_path / name / MODEL) for name in ("whole", "part"))
    assert all(torch.equal(expected[key], found[key]) for key in expected)


def test_every_seed_that_is_let_in_trains(plane_store, tmp_path):
    found = []
    for seed in (0, 1 << 32, (1 << 64) - 1):
        assert TrainingOptions(seed=seed).seed == seed
        fit_dpc(setup_dpc(tiny("dpc-small", 1), plane_store, tmp_path / str(seed), seed=seed))
        weights = load_file(tmp_path / str(seed) / MODEL)
        found.append(torch.cat([weights[name].flatten() for name in sorted(weights)]))
    assert not torch.equal(found[0], found[1])
    assert not torch.equal(found[1], found[2])


def test_a_finished_run_is_left_as_it_is(plane_store, tmp_path):
    fit_dpc(setup_dpc(tiny("dpc-small", 1), plane_store, tmp_path))
    files = [file for file in tmp_path.rglob("*") if file.is_file()]
    before = [file.read_bytes() for file in files]
    again = {"resume": True, "provenance": {"data": "moved"}}
    fit_dpc(setup_dpc(tiny("dpc-small", 1), plane_store, tmp_path, **again))
    assert [file.read_bytes() for file in files] == before


def test_a_finished_run_that_lost_its_model_writes_it_again(plane_store, tmp_path):
    fit_dpc(setup_dpc(tiny("dpc-small", 1), plane_store, tmp_path))
    before = load_file(tmp_path / MODEL)
    (tmp_path / MODEL).unlink()
    fit_dpc(setup_dpc(tiny("dpc-small", 1), plane_store, tmp_path, resume=True))
    found = load_file(tmp_path / MODEL)
    assert all(torch.equal(before[key], found[key]) for key in before)


def test_two_kinds_of_sensor_are_refused(planes, cars, tmp_path):
    store = packed(tmp_path / "store", [replace(planes[0], name="plane"), cars[0]])
    with pytest.raises(BadInputError, match="split it"):
        setup_dpc(tiny("dpc-small"), store, tmp_path)


def test_the_wrong_data_is_refused_in_a_sentence(plane_store, car_store, tmp_path):
    with pytest.raises(BadInputError, match="choose dpc-lidar"):
        setup_dpc(tiny("dpc-small"), car_store, tmp_path)
    with pytest.raises(BadInputError, match="choose dpc or dpc-dagger"):
        setup_dpc(tiny("dpc-lidar-small"), plane_store, tmp_path)
    far = replace(tiny("dpc-small"), network=replace(tiny("dpc-small").network, points=10))
    far = replace(
        far, network=replace(far.network, volume=replace(far.network.volume, distance=9.0))
    )
    refused(setup_dpc, far, plane_store, tmp_path, match="outside of DPC's images")


@pytest.fixture(scope="module")
def camera_method(plane_store, tmp_path_factory) -> Dpc:
    run = setup_dpc(tiny("dpc-dagger-small"), plane_store, tmp_path_factory.mktemp("run"))
    fit_dpc(run)
    return load(run.folder / MODEL)


@pytest.fixture(scope="module")
def lidar_method(car_store, tmp_path_factory) -> Dpc:
    run = setup_dpc(tiny("dpc-lidar-small"), car_store, tmp_path_factory.mktemp("run"))
    fit_dpc(run)
    return load(run.folder / MODEL)


def test_a_camera_s_object_is_put_where_it_is(camera_method, planes):
    track = planes[0]
    cloud = camera_method.complete(track.scans[0], track.sensor)
    assert cloud.shape == (100, 3)
    assert np.abs(cloud - (0, 0, 2)).max() < 1.1
    T = camera_method.register_track(track.scans, track.sensor)
    assert rotation_angle(T.rotation[track.middle]).item() == pytest.approx(0, abs=1e-3)


def test_a_car_is_put_where_its_scan_is_and_turns_with_it(lidar_method, cars):
    track = cars[0]
    scan = track.scans[0]
    cloud = lidar_method.complete(scan, track.sensor)
    assert np.linalg.norm(cloud - scan.mean(0), axis=1).max() < 6
    turn = np.array(((0, -1, 0), (1, 0, 0), (0, 0, 1)), np.float32)  # a quarter of yaw
    turned = lidar_method.complete(scan @ turn.T, track.sensor)
    np.testing.assert_allclose(turned, cloud @ turn.T, atol=1e-3)


def test_what_dpc_cannot_see_it_refuses(camera_method, lidar_method, planes, cars):
    plane, car = planes[0], cars[0]
    refused(camera_method.complete, car.scans[0], car.sensor, match="a lidar scan")
    refused(lidar_method.complete, plane.scans[0], plane.sensor, match="a camera scan")
    refused(camera_method.complete, -plane.scans[0], plane.sensor, match="outside of DPC's image")


def test_the_row_says_what_it_is_given(camera_method, lidar_method):
    assert "IS GIVEN the camera's distance (2)" in camera_method.about
    assert "cube of 6 m, radial offset" in lidar_method.about
    assert "half turns" not in camera_method.about
    helped = replace(camera_method.settings, depth=4.0, half_turn=True)
    told = replace(camera_method, settings=helped).about
    assert "trained on silhouettes and depths, half turns tried;" in told
