# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Probabilities are stated where weights bring them, travel with these, and decide what is told."""

import dataclasses
import math

import numpy as np
import pytest
import torch
from tests.models import CONFIG, SETTINGS, scan

from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.confidence import VIEW_PX, VIEWED_M, features_of, odds_of
from wildshape.inference.predictor import Predictor, load
from wildshape.method.checkpoint import save_checkpoint
from wildshape.method.network import Poses, ShapePoseNet
from wildshape.method.trust import (
    OF_SCAN,
    OF_TRACK,
    Calibrator,
    LogisticRegression,
    ScanFeatures,
    Surface,
    TrackFeatures,
    Trust,
)
from wildshape.method.trust_features import (
    rival_margin,
    scan_features,
    surfaces,
    track_features,
    views_apart,
)
from wildshape.records import Box
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.simulate.sensor import DepthCamera

FACING = dataclasses.replace(SETTINGS, facing=True)


def calibrator(chosen, bias):
    lines = [LogisticRegression(n, (0.1,) * len(n), (0.0,) * len(n), bias) for n in chosen]
    return Calibrator(*lines)


def trusting(bias=1.0):
    trust = Trust(calibrator(OF_SCAN, bias), calibrator(OF_TRACK, bias), "a test")
    torch.manual_seed(0)
    settings = dataclasses.replace(FACING, trust=trust)
    return Predictor(ShapePoseNet(CONFIG).eval(), settings)


def test_more_points_than_any_calibration_saw_say_no_more():
    """A vehicle of 300,000 points was one with 0.6, the same with 2,000 with 0.98."""
    dense = np.tile(scan(0), (1 + 80_000 // len(scan(0)), 1))
    known, denser = (features_of(some, 0.1, torch.zeros(6)) for some in (dense[:40_000], dense))
    assert denser.log_points == known.log_points == pytest.approx(math.log(40_000))


@pytest.mark.parametrize("finer", [1, 3])
def test_a_finer_camera_says_no_more_of_the_same_view(finer):
    """A chair of 2,000 points was one with 0.96, the same with 9,500 with 0.08."""
    camera = DepthCamera()
    steps = np.arange(-40 * finer, 40 * finer) + 0.5
    across, down = np.meshgrid(steps, steps)
    directions = np.stack((across, down, np.full_like(across, camera.focal_px * finer)), -1)
    view = (2 / camera.focal_px / finer * directions.reshape(-1, 3)).astype(np.float32)
    known = features_of(view, 0.1, torch.zeros(6), "camera")
    assert camera.focal_px == VIEW_PX
    assert len(view) == 6400 * finer**2
    assert known.log_points == pytest.approx(math.log(6400))


@pytest.mark.parametrize(("away", "known"), [(0.9, VIEWED_M[0]), (1.8, 1.8), (8.0, VIEWED_M[1])])
def test_a_camera_elsewhere_says_what_one_says_that_calibrations_saw(away, known):
    """Chairs no worse completed were that with 0.06 from 1.1 m, with 0.999 from 3 m."""
    across = np.linspace(-0.25, 0.25, 80)
    x, y = np.meshgrid(across, across)
    view, usual = (np.stack((x, y, 0 * x + z), -1).reshape(-1, 3) for z in (away, known))
    found, same = (
        features_of(one.astype(np.float32), 0.1, torch.zeros(6), "camera") for one in (view, usual)
    )
    assert found.log_range == pytest.approx(math.log(known), abs=1e-3)
    assert found.log_points == pytest.approx(same.log_points, abs=0.02)


def test_the_views_that_calibrations_saw_were_so_far_away():
    config = SimulationConfig(
        tracks=2, scans=5, sensor="depth-camera", category="chair", shape_points=64
    )
    for track in simulate_tracks(config, seed=0, workers=1):
        for seen in track.scans:
            assert VIEWED_M[0] < np.linalg.norm(seen.mean(0)) < VIEWED_M[1]


def test_the_confidence_is_the_product_and_says_what_is_unsure(tmp_path):
    made = trusting()
    save_checkpoint(tmp_path / "m.safetensors", made.network, made.settings)
    trust = made.settings.trust
    assert trust is not None
    done = load(tmp_path / "m.safetensors").complete(scan())
    said = trust.scan(ScanFeatures(*done.evidence)._asdict())
    assert (done.p_pose, done.p_box, done.p_kind) == tuple(said)
    assert done.confidence == pytest.approx(said.product)
    doubtful = trusting(bias=-9.0).complete(scan())
    assert {"low_confidence", "unsure_heading", "unsure_box", "other_kind"} <= set(doubtful.reasons)
    far_too_large = made.complete(9 * scan())
    assert far_too_large.warning
    assert far_too_large.confidence == far_too_large.p_kind == 0


def test_a_track_has_its_own():
    made = trusting(bias=-2.0)
    trust = made.settings.trust
    assert trust is not None
    for one in made.complete_track([scan(seed) for seed in range(3)]):
        known = TrackFeatures(*one.evidence)
        assert (one.p_pose, one.p_box, one.p_kind) == tuple(trust.track(known._asdict()))
        assert known.log_points == pytest.approx(math.log(len(scan(0))))


def test_what_a_scan_counts_in_its_track():
    done = trusting().complete(scan())
    sure = dataclasses.replace(done, p_pose=0.9, p_box=0.5, warning="")
    assert odds_of(sure) == pytest.approx(0.45 / 0.55)
    assert odds_of(dataclasses.replace(sure, p_pose=1.0, p_box=1.0)) < 50
    assert odds_of(dataclasses.replace(sure, warning="too large")) < 0.01
    assert odds_of(dataclasses.replace(sure, p_pose=None, confidence=0.3)) == 0.3


def test_without_probabilities_or_refinement_it_is_as_before():
    made = trusting()
    raw = Predictor(made.network, made.settings, raw=True).complete(scan())
    plain = Predictor(made.network, FACING, raw=True).complete(scan())
    assert (raw.p_pose, raw.p_box, raw.p_kind) == (None, None, None)
    assert raw.confidence == plain.confidence
    assert raw.reasons == plain.reasons


def test_rays_are_evidence():
    made, points = trusting(), scan()
    away = points / np.linalg.norm(points, axis=1, keepdims=True)
    through = SightLines(away, np.full(len(points), 60.0, np.float32))
    alone, seen = made.complete(points), made.complete(points, rays=through)
    assert math.isnan(ScanFeatures(*alone.evidence).free)
    known = ScanFeatures(*seen.evidence)
    assert 0 <= known.free <= 1


def test_the_rival_looks_another_way():
    """Hypotheses at 0, 5 and 180 degrees: the cheapest one's neighbour is no rival."""
    angle = torch.deg2rad(torch.tensor((0.0, 5.0, 180.0)))
    c, s, zero, one = angle.cos(), angle.sin(), torch.zeros(3), torch.ones(3)
    rows = torch.stack((c, -s, zero, s, c, zero, zero, zero, one), -1)
    poses = Poses(rows.view(1, 3, 3, 3), torch.zeros(1, 3, 3), torch.zeros(1, 3))
    assert rival_margin(poses, torch.tensor([[0.10, 0.11, 0.16]])).item() == pytest.approx(0.06)
    assert rival_margin(poses, torch.tensor([[0.10, 0.11, 9.0]])).item() == pytest.approx(0.3)


def test_how_far_apart_views_are():
    """A sensor 10 m from an object that it sees from 20 degrees left and right of its front."""
    angle = torch.deg2rad(torch.tensor((-20.0, 20.0, 20.0, -20.0)))
    c, s, zero = angle.cos(), angle.sin(), torch.zeros(4)
    rotation = torch.stack((c, -s, zero, s, c, zero, zero, zero, zero + 1), -1).view(4, 3, 3)
    seen = SE3(rotation, torch.tensor((-10.0, 0.0, 0.0)).repeat(4, 1))
    assert views_apart(seen) == pytest.approx(20, abs=1e-3)
    assert views_apart(seen[1:3]) == pytest.approx(0, abs=1e-3)


def patch(bend, turn_deg, noise, seed=0):
    """Points on a square metre that faces along x, bent to this curvature, turned about z."""
    rng = np.random.default_rng(seed)
    y, z = rng.uniform(-0.5, 0.5, (2, 300))
    x = bend * y**2 / 2 + rng.normal(0, noise, 300)
    angle = math.radians(turn_deg)
    turned = (x * math.cos(angle) - y * math.sin(angle), x * math.sin(angle) + y * math.cos(angle))
    return np.stack((*turned, z), 1).astype(np.float32)


def test_what_a_surface_is_like():
    """Square to the box or not, flat, gently bent or rough; each scan for itself."""
    scans = [patch(0, 0, 0.002), patch(0, 45, 0.002), patch(2, 0, 0.002), patch(0, 0, 0.05)]
    upright = torch.eye(3).repeat(4, 1, 1)
    wall, askew, bent, rough = found = surfaces(scans, upright)
    assert wall.square == pytest.approx(1, abs=0.01)
    assert askew.square == pytest.approx(0.5, abs=0.01)
    assert wall.bent < 0.05 < 0.2 < bent.bent
    assert wall.rough < bent.rough < rough.rough
    few = scans[2][:40]
    assert surfaces([few, *scans], torch.eye(3).repeat(5, 1, 1))[1:] == found
    assert surfaces([few], upright[:1]) == surfaces([few, *scans], torch.eye(3).repeat(5, 1, 1))[:1]


def test_a_scan_of_few_points_is_as_rough_as_its_own_neighbourhoods_are():
    scan = patch(1, 30, 0.03)[:60]
    thick = []
    for point in scan.astype(np.float64):
        near = scan[np.argsort(((scan - point) ** 2).sum(1))[:12]].astype(np.float64)
        thick.append(math.sqrt(np.linalg.eigvalsh(np.cov(near.T, bias=True))[0]))
    (found,) = surfaces([scan], torch.eye(3)[None])
    assert found.rough == pytest.approx(math.log(np.quantile(thick, 0.9)), abs=1e-3)


def test_what_is_known_of_a_track_is_the_mean_of_its_scans_the_fuller_the_heavier():
    made = trusting().complete(scan())
    base = ScanFeatures(*np.linspace(0.1, 1.4, 14))
    few = base._replace(rival=0.1, square=0.6, log_points=math.log(100), log_length=1.4)
    many = base._replace(rival=0.3, square=0.9, log_points=math.log(4000), log_length=1.6)
    done = [dataclasses.replace(made, evidence=tuple(one)) for one in (few, many)]
    poses = SE3(torch.eye(3).repeat(2, 1, 1), torch.tensor(((8.0, 0.0, 0.0), (9.0, 0.0, 0.0))))
    cost = torch.tensor((0.05, 0.2))
    of_few, of_many = track_features(done, torch.arange(2), poses, (4.3, 1.8, 1.5), cost)
    share = math.sqrt(500) / (math.sqrt(100) + math.sqrt(500))  # of no more than 500 points
    assert of_few.rival == pytest.approx(0.1 + 0.2 * share)
    assert of_few.square == pytest.approx(0.6 + 0.3 * share)
    assert of_few.log_points == pytest.approx(math.log(4000))
    assert of_few.length_spread == pytest.approx(0.1)
    assert of_few.size_off == pytest.approx(0)
    assert of_few == of_many._replace(scan_cost=of_few.scan_cost)
    assert (of_few.scan_cost, of_many.scan_cost) == pytest.approx((math.log(0.05), math.log(0.2)))


def test_a_scan_is_deep_in_its_box_where_it_is_farther_in_than_labels_err():
    c, s = math.cos(0.5), math.sin(0.5)
    box = Box((10.0, 2.0, 0.5), (4.0, 2.0, 1.5), (math.cos(0.25), 0.0, 0.0, math.sin(0.25)))
    made = dataclasses.replace(trusting().complete(scan()), box=box)
    x, y, z = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-1, 1, 21), np.linspace(-0.7, 0.7, 8))
    inside = np.stack((x.ravel(), y.ravel(), z.ravel()), 1)
    turned = inside @ np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)))
    points = (turned + box.centre).astype(np.float32)
    found = scan_features(made, points, Surface(1.0, 0.0, 0.0), 0.1, None)
    expected = (np.abs(inside) < np.array((1.75, 0.75, 0.5))).all(1).mean()
    assert found.deep == pytest.approx(expected, abs=0.03)
    assert found.seen_length == pytest.approx(1.0, abs=0.02)
    assert found.seen_width == pytest.approx(1.0, abs=0.02)
