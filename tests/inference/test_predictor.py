# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What holds for any weights: frames, order, batches, warnings. Learning is tested elsewhere."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.models import CONFIG, SETTINGS, scan
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.inference.confidence import confidence_of, features_of
from wildshape.inference.config import BoxConfig, InferenceConfig, TrackConfig
from wildshape.inference.point_inputs import check_sensor
from wildshape.inference.predictor import Predictor, load
from wildshape.method.checkpoint import save_checkpoint, weights_file
from wildshape.method.confidence import ConfidenceFeatures
from wildshape.method.network import ShapePoseNet
from wildshape.records import Sensor


@pytest.fixture(scope="module")
def predictor():
    torch.manual_seed(0)
    return Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS)


def assert_same(a, b, atol=2e-4):
    np.testing.assert_allclose(a.points, b.points, atol=atol)
    torch.testing.assert_close(a.pose.matrix, b.pose.matrix, atol=atol, rtol=0)
    np.testing.assert_allclose(a.box.centre, b.box.centre, atol=atol)
    assert a.branch == b.branch
    assert a.cost == pytest.approx(b.cost, abs=atol)
    assert a.confidence == pytest.approx(b.confidence, abs=atol)


def test_what_comes_out(predictor):
    done = predictor.complete(scan())
    assert done.points.shape == (600, 3)
    assert done.points.dtype == np.float32
    assert done.pose.matrix.dtype == torch.float64
    assert not done.pose.matrix.requires_grad
    assert 0 < done.confidence < 1
    assert 0 <= done.branch < 4
    assert (done.warning, done.refined) == ("", False)
    assert done.seconds > 0


def test_pose_carries_the_canonical_shape_to_the_sensor(predictor):
    """Twice the same canonical shape: `inv(T_sensor_canonical)` gives it back, mirror plane y."""
    done = predictor.complete(scan())
    canonical = done.pose.inverse().apply_numpy(done.points)
    left, right = np.split(canonical, 2)
    np.testing.assert_allclose(left, right * [1, -1, 1], atol=1e-4)


def test_order_does_not_matter(predictor):
    points = scan()
    shuffled = points[np.random.default_rng(1).permutation(len(points))]
    assert_same(predictor.complete(shuffled), predictor.complete(points), atol=0)


def test_the_range_of_many_points_is_that_of_their_mean_in_any_order():
    points = np.repeat(scan(), 3000, axis=0)
    expected = math.log(np.linalg.norm(points.astype(np.float64).mean(0)))
    for given in (points, points[::-1], points[np.random.default_rng(1).permutation(len(points))]):
        assert features_of(given, 0.1, torch.zeros(6)).log_range == pytest.approx(
            expected, abs=1e-9
        )


def test_nan_rows_do_not_matter(predictor):
    points = scan()
    dirty = np.concatenate((points, [[np.nan, 0, 0], [0, np.inf, 0]])).astype(np.float32)
    assert_same(predictor.complete(dirty), predictor.complete(points))


def test_many_are_completed_one_by_one(predictor):
    """More than one batch: scan i alone gives what scan i among others gives."""
    scans = [scan(seed, count=20 + 9 * seed) for seed in range(37)]
    together = list(predictor.complete_many(scans))
    assert len(together) == 37
    for i in (0, 1, 31, 32, 36):
        assert_same(together[i], predictor.complete(scans[i]))


def test_a_track_of_one_scan_says_what_it_took(predictor, monkeypatch):
    looked = Predictor.look
    clock = iter(range(100))

    def look(*given):
        next(clock)  # as if it took a second
        return looked(*given)

    monkeypatch.setattr(Predictor, "look", look)
    monkeypatch.setattr("wildshape.inference.predictor.time.perf_counter", lambda: next(clock))
    (done,) = predictor.complete_track([scan()])
    assert done.seconds >= 2  # a second between two looks at the clock, and that of the network


def test_nothing_cannot_be_posed_or_fused(predictor):
    assert predictor.complete_track([]) == []
    for asked in (predictor.poses, predictor.register_track, predictor.fuse):
        refused(asked, [], match="no scans")


def test_repeatable(predictor):
    first, second = predictor.complete(scan()), predictor.complete(scan())
    np.testing.assert_array_equal(first.points, second.points)
    assert first.cost == second.cost


def test_the_branch_of_least_cost_speaks(predictor):
    single = [
        Predictor(_only_branch(predictor.network, k), _with_network(branches=1)) for k in range(4)
    ]
    for seed in range(5):
        costs = [p.complete(scan(seed)).cost for p in single]
        done = predictor.complete(scan(seed))
        assert done.branch == int(np.argmin(costs))
        assert done.cost == pytest.approx(min(costs), abs=1e-5)


def _with_network(**changes):
    return dataclasses.replace(SETTINGS, network=dataclasses.replace(CONFIG, **changes))


def _only_branch(network, k):
    only = ShapePoseNet(dataclasses.replace(CONFIG, branches=1)).eval()
    weights = network.state_dict()
    width = CONFIG.pose[0]
    for name in ("weight2", "bias2", "weight3", "bias3"):
        weights[f"pose.{name}"] = weights[f"pose.{name}"][k : k + 1]
    for name in ("weight", "bias"):
        layer = f"pose.layer1.{name}"
        weights[layer] = weights[layer][k * width : (k + 1) * width]
    only.load_state_dict(weights)
    return only


def test_box_holds_the_points_and_is_tight(predictor):
    done = predictor.complete(scan())
    R = rotation_from_quaternion(torch.tensor(done.box.quaternion_wxyz).double()).numpy()
    local = (done.points - np.array(done.box.centre)) @ R
    half = np.array(done.box.size) / 2
    outside = (np.abs(local) > half + 1e-3).any(1).mean()
    assert outside <= 6 * 0.005
    # Tight: no side lies further out than both the shape and the scan.
    seen = (scan() - np.array(done.box.centre)) @ R
    both = np.concatenate((local, seen, seen * (1, -1, 1)))
    assert (half <= np.abs(both).max(0) + 1e-3).all()
    assert (half >= np.quantile(np.abs(local), 0.95, axis=0)).all()
    # It looks where the canonical frame does, made level by a few degrees at most.
    np.testing.assert_allclose(R[:, 1], done.pose.rotation[:, 1], atol=1e-5)
    assert R[:, 2] @ done.pose.rotation[:, 2].numpy() > np.cos(np.radians(4.1))


def test_what_comes_out_moves_with_the_scan(predictor):
    """A camera's centring is that of a box: a scan elsewhere is the same scan, elsewhere."""
    camera = dataclasses.replace(_with_network(branches=1), sensor="camera")
    single = Predictor(_only_branch(predictor.network, 0), camera)
    offset = np.array([4.0, -2.0, 8.0], np.float32)
    here, there = single.complete(scan()), single.complete(scan() + offset)
    np.testing.assert_allclose(there.points, here.points + offset, atol=1e-4)
    np.testing.assert_allclose(there.box.centre, here.box.centre + offset, atol=0.1)
    moved = there.pose.translation - here.pose.translation
    np.testing.assert_allclose(moved, offset, atol=1e-4)
    middle = (scan().min(0) + scan().max(0)) / 2
    assert np.abs(here.points.mean(0) - middle).max() < 1


def test_registration_is_as_sure_as_the_less_sure_scan(predictor):
    scans = [scan(seed) for seed in range(4)]
    sure = [predictor.complete(s).confidence for s in scans]
    low, high = int(np.argmin(sure)), int(np.argmax(sure))
    assert sure[low] < sure[high] - 0.01
    for pair in ((low, high), (high, low)):
        found = predictor.register(*(scans[i] for i in pair)).confidence
        assert found == pytest.approx(sure[low], abs=1e-5)


def test_registration_back_is_the_inverse(predictor):
    a, b = scan(1), scan(2)
    there, back = predictor.register(a, b), predictor.register(b, a)
    product = (there.T_target_source @ back.T_target_source).matrix
    torch.testing.assert_close(product, torch.eye(4).double(), atol=1e-4, rtol=0)
    assert 0 <= there.inlier_ratio <= 1


def test_registration_is_through_the_canonical_frame(predictor):
    a, b, c = scan(1), scan(2), scan(3)
    T_c_a = predictor.register(a, c).T_target_source
    around = predictor.register(b, c).T_target_source @ predictor.register(a, b).T_target_source
    torch.testing.assert_close(around.matrix, T_c_a.matrix, atol=1e-4, rtol=0)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_tracks_are_registered_to_and_fused_in_the_middle_scan(predictor, count):
    scans = [scan(seed, count=20 + seed) for seed in range(count)]
    T_middle_scan = predictor.register_track(scans)
    middle = count // 2
    assert len(T_middle_scan) == count
    torch.testing.assert_close(
        T_middle_scan[middle].matrix, torch.eye(4).double(), atol=1e-5, rtol=0
    )
    pairwise = predictor.register(scans[0], scans[middle]).T_target_source
    torch.testing.assert_close(T_middle_scan[0].matrix, pairwise.matrix, atol=2e-4, rtol=0)
    fused = predictor.fuse(scans)
    assert fused.dtype == np.float32
    parts = np.split(fused, np.cumsum([len(s) for s in scans])[:-1])
    np.testing.assert_allclose(parts[middle], scans[middle], atol=1e-4)
    np.testing.assert_allclose(parts[0], T_middle_scan[0].apply_numpy(scans[0]), atol=2e-4)


@pytest.mark.parametrize("factor", [20.0, 0.01])
def test_a_scan_of_another_scale_is_flagged(predictor, factor):
    done = predictor.complete(scan() * np.float32(factor))
    assert done.confidence == 0
    assert "extent" in done.warning
    assert "unit" in done.warning
    assert np.isfinite(done.points).all()


@pytest.mark.parametrize("kind", [np.float64, torch.float64, np.float32, np.int64])
def test_a_scan_far_from_its_sensor_is_refused_in_any_precision(predictor, kind):
    far = scan().astype(np.float64) + np.array([4e5, 5e6, 100])
    given = torch.from_numpy(far) if kind is torch.float64 else far.astype(kind)
    for call in (predictor.complete, lambda points: predictor.register(scan(), points)):
        refused(call, given, match=r"5\.016e\+06 m from the origin.*float64")


def test_a_scan_moved_to_its_own_centre_is_flagged(predictor):
    moved = scan() - scan().mean(0)
    done = predictor.complete(moved)
    assert done.confidence == 0
    assert "no sensor can have stood" in done.warning
    assert "sensor_inside" in done.reasons
    assert predictor.register(scan(), moved).warning == done.warning


def test_another_kind_of_sensor_is_flagged(predictor):
    done = predictor.complete(scan(), Sensor("camera"))
    assert done.confidence == 0
    assert done.warning.startswith("a camera scan, but the model was trained on lidar")
    assert predictor.complete(scan(), Sensor("lidar")).warning == ""
    scans = [scan(seed) for seed in range(4)]
    long = InferenceConfig(track=TrackConfig(key_scans=3))
    for of in (predictor, Predictor(predictor.network, SETTINGS, config=long)):
        found = [*of.complete_track(scans, Sensor("camera"))]
        found += of.complete_checked(scans, Sensor("camera"))
        found += of.complete_checked(scans, Sensor("camera"), track=True)
        found += of.complete_many(scans, Sensor("camera"))
        found.append(of.register(scans[0], scans[1], Sensor("camera")))
        assert {(one.confidence, one.warning) for one in found} == {(0, done.warning)}


def test_confidence_falls_with_the_cost(predictor):
    features = ConfidenceFeatures(*[0.0] * len(ConfidenceFeatures._fields))
    costs = (1e-4, 0.1, 0.3, 1.0, 100.0)
    values = [
        confidence_of(features._replace(log_cost=math.log(cost)), predictor.settings)
        for cost in costs
    ]
    assert values[0] == pytest.approx(1, abs=1e-6)
    assert values[2] == pytest.approx(0.5)
    assert values == sorted(values, reverse=True)
    assert values[-1] < 1e-4


@pytest.mark.parametrize("count", [0, 15])
def test_too_few_points_are_refused_by_name(predictor, count):
    with pytest.raises(BadInputError, match=f"scan 1: {count} finite points; at least 16"):
        list(predictor.complete_many([scan(), scan(count=40)[:count]]))
    with pytest.raises(BadInputError, match=f"source: {count} finite"):
        predictor.register(scan()[:count], scan())
    with pytest.raises(BadInputError, match=f"scan 33: {count} finite points"):
        list(predictor.complete_many([*[scan()] * 33, scan(count=40)[:count]]))


def test_a_speck_and_what_is_no_sensor_are_refused(predictor):
    with pytest.raises(BadInputError, match=r"at least 0\.01 m"):
        predictor.complete(scan() * np.float32(1e-4))
    refused(check_sensor, "lidar", match=r"expected a wildshape.Sensor, found 'lidar'")


def test_sixteen_points_are_enough(predictor):
    assert np.isfinite(predictor.complete(scan(count=16)).points).all()


def test_no_scans_no_completions(predictor):
    assert list(predictor.complete_many([])) == []


def test_shipped_weights_have_names(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shipped = weights_file(None)
    assert weights_file("default") == weights_file(Path("default")) == shipped
    (tmp_path / "default").write_text("a file of the user's")
    assert weights_file("default") == Path("default")
    for missing in ("zeppelin", "runs/default"):
        refused(weights_file, missing, match=f"{missing}: no such .* airplane, car, chair, def")


def test_level_sensors_are_taken_at_their_word_unless_told_otherwise(tmp_path):
    """What the checkpoint calls up is where the poses of scans that are nearly level point."""
    torch.manual_seed(0)
    of = dataclasses.replace(SETTINGS, facing=True, up=(0.02, 0.0, 0.9998))
    path = tmp_path / "model.safetensors"
    save_checkpoint(path, ShapePoseNet(CONFIG).eval(), of)
    up = load(path).settings.up
    assert up == of.up
    axis = torch.tensor(up, dtype=torch.float64)
    off = []
    for level in (True, False):
        poses = load(path, level=level).poses([scan(i) for i in range(80)])
        off.append(torch.rad2deg(torch.acos((poses.rotation[:, 2] @ axis).clamp(-1, 1))))
    near = off[1] < 4
    assert int(near.sum()) >= 3
    assert float((off[0] / off[1])[near].mean()) < 0.9


def test_lengths_of_the_box_shrink_with_the_objects_trained_on(predictor):
    """A metre before an end was a metre, also of objects that are smaller than that."""
    points = np.float32(0.3) * scan() + np.array([5.0, 0.0, 0.0], np.float32)

    def length(largest_m, **lengths):
        of = dataclasses.replace(SETTINGS, extent_m=(0.1, largest_m))
        config = InferenceConfig(box=BoxConfig(hidden_share=0.3, **lengths))
        return Predictor(predictor.network, of, config=config).complete(points).box.size[0]

    small = length(0.5, near_m=0.1, unknown_m=1.0)
    assert small == length(5.0, near_m=0.01, unknown_m=0.1)
    assert small > 1.5 * length(5.0, near_m=0.1, unknown_m=1.0)


def test_load(predictor, tmp_path):
    path = tmp_path / "model.safetensors"
    save_checkpoint(path, predictor.network, SETTINGS)
    assert_same(load(path).complete(scan()), predictor.complete(scan()), atol=1e-6)
    assert (load(path).named, load().named) == (path, None)
    refused(load, tmp_path / "gone.safetensors", match="no such checkpoint")
