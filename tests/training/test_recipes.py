# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The presets hold the paper's numbers (METHOD 3 and 6), and every one of them trains."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.packed import packed
from tests.refusal import refused

from wildshape.geometry.projection.visibility import PixelBins, PolarBins
from wildshape.method.network import ShapePoseNet
from wildshape.records import Sensor
from wildshape.training.batches.fused import FusedSampler
from wildshape.training.batches.occlusion_augmentation import partly_hidden
from wildshape.training.batches.views import ViewSampler
from wildshape.training.config import learning_rate
from wildshape.training.objectives import WeaklySupervised
from wildshape.training.recipes import PRESETS, paper_lidar, paper_views, recipe_for, shape_oracle
from wildshape.training.self_training.objective import SelfTaught
from wildshape.training.self_training.targets import true_targets


@pytest.mark.parametrize("recipe", [paper_lidar(), paper_views()])
def test_what_both_paper_presets_share(recipe):
    assert recipe.network.encoder == (128, 256, 512, 1024)
    assert recipe.network.decoder == (1024, 1024)
    assert (recipe.network.points, recipe.network.branches) == (2048, 4)
    assert (recipe.network.pose, recipe.network.start) == ((512, 128), (0.5, 0.5, 0.5))
    assert (recipe.network.mirror, recipe.network.selector) == (False, False)
    assert (recipe.network.scale, recipe.network.backbone, recipe.network.rays) == (
        1.0,
        "pcn",
        None,
    )
    assert (recipe.loss.hindsight, recipe.loss.belief) == ("scan", 0)
    assert (recipe.loss.time_ordered, recipe.loss.agree_at) == (False, ())
    assert (recipe.views.tracks, recipe.views.views, recipe.views.window) == (8, 4, 20)
    assert (recipe.views.turn, recipe.views.min_points) == ("none", 100)
    assert (recipe.optim.lr, recipe.optim.decay_every) == (1e-4, 100_000)
    assert (recipe.optim.warmup, recipe.optim.average, recipe.optim.clip) == (0, 0, 0)


def test_lidar():
    recipe = paper_lidar()
    assert (recipe.loss.beta, recipe.views.points, recipe.views.sensor) == (0.05, 1024, "lidar")
    assert recipe.loss.projection == PolarBins(0.02, 0.02)
    assert recipe.network.spread == "yaw"
    assert (recipe.optim.steps, recipe.optim.decay) == (400_000, 0.7)


def test_views():
    recipe = paper_views()
    assert (recipe.loss.beta, recipe.views.points, recipe.views.sensor) == (0.25, 3096, "camera")
    assert recipe.loss.projection == PixelBins(1 / 30)
    assert recipe.network.spread == "sphere"
    assert (recipe.optim.steps, recipe.optim.decay) == (300_000, 0.5)


@pytest.mark.parametrize(("recipe", "factor"), [(paper_lidar(), 0.7), (paper_views(), 0.5)])
def test_paper_schedules(recipe, factor):
    optim = recipe.optim
    for step, drops in ((0, 0), (99_999, 0), (100_000, 1), (199_999, 1), (200_000, 2)):
        assert learning_rate(step, optim) == pytest.approx(1e-4 * factor**drops)
    last = optim.steps - 1
    assert learning_rate(last, optim) == pytest.approx(1e-4 * factor ** (last // 100_000))


@pytest.mark.parametrize("name", ["paper-lidar", "small"])
def test_other_steps_stretch_the_schedule(car_store, name):
    own = PRESETS[name]().optim
    few = recipe_for(car_store, name, own.steps // 20).optim
    assert few.steps == own.steps // 20
    for step in range(few.steps // 5, few.steps, few.steps // 10):
        assert learning_rate(step, few) == pytest.approx(learning_rate(20 * step, own))


def test_one_step_is_a_schedule_too(car_store):
    assert recipe_for(car_store, "paper-lidar", 1).optim.decay_every == 1


def test_a_store_of_two_kinds_of_sensor_is_refused(cars, tmp_path):
    store = packed(tmp_path, [cars[0], replace(cars[1], sensor=Sensor("camera"))])
    refused(recipe_for, store, "small", None, match="split it")


def test_a_recipe_is_of_the_data_s_kind_of_sensor_and_the_paper_s_are_of_their_own(cars, tmp_path):
    store = packed(tmp_path, [replace(cars[0], sensor=Sensor("camera"))])
    for name in ("small", "views", "paper-views"):
        assert recipe_for(store, name, None).views.sensor == "camera"
    refused(recipe_for, store, "paper-lidar", None, match="preset paper-lidar is for lidar scans")


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_named_and_takes_a_step(name, car_store):
    recipe = PRESETS[name]()
    assert recipe.name == name
    assert recipe == PRESETS[name]()
    torch.manual_seed(0)
    views = replace(recipe.views, tracks=1, views=2, min_points=16)
    network = ShapePoseNet(recipe.network)
    batch = ViewSampler(car_store, torch.arange(8).numpy(), views).draw(0)
    WeaklySupervised(network, recipe.loss)(batch).loss.backward()
    for weight, p in network.named_parameters():
        assert p.grad is not None, weight
        assert p.grad.isfinite().all(), weight
        assert p.grad.abs().sum() > 0, weight


def test_the_papers_oracle_learns_true_shapes_of_scans_as_recorded_and_no_pose(car_store):
    recipe = shape_oracle(replace(paper_lidar(), views=replace(paper_lidar().views, tracks=1)))
    rules, views = recipe.self_training, ViewSampler(car_store, np.arange(8), recipe.views)
    targets = true_targets(views)
    batch = FusedSampler(views, targets, rules.draw).draw(3)
    for drawn, known in ((batch.shapes, targets.shapes), (batch.rotation, targets.rotation)):
        assert (drawn[:, None] - known).flatten(2).abs().amax(-1).amin(1).max() < 1e-6
    scan, rng = torch.from_numpy(car_store.scan_points(0)), np.random.default_rng(0)
    plain = rules.draw.occlusion
    assert all(partly_hidden(scan, rng, plain).points is scan for _ in range(50))
    torch.manual_seed(0)
    network = ShapePoseNet(recipe.network)
    found = SelfTaught(network, complete=True, distances=rules.loss)(batch)
    shapes = network.canonical(network.encode(batch.scans))
    apart = torch.cdist(shapes, batch.shapes, compute_mode="donot_use_mm_for_euclid_dist")
    torch.testing.assert_close(found.loss, apart.amin(2).mean() + apart.amin(1).mean())
    found.loss.backward()
    for name, weight in network.named_parameters():
        assert weight.grad is not None
        assert bool(weight.grad.any()) != name.startswith("pose."), name
