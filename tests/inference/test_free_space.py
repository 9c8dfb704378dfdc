# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays of a frame held against completed shapes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import drive_by, poses_of, shape_of
from tests.refusal import refused

import wildshape
from wildshape.geometry.projection.visibility import PolarBins
from wildshape.geometry.transforms.rotation import rotation_from_vector
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference import predictor, single_scans
from wildshape.inference.config import FreeSpaceConfig, InferenceConfig, TrackConfig
from wildshape.inference.free_space import SeenScores, Sights, without_free_space
from wildshape.inference.point_inputs import as_rays
from wildshape.inference.predictor import Predictor
from wildshape.inference.single_scans import Looked
from wildshape.inference.tracks import complete_track
from wildshape.io.rays import write_rays
from wildshape.method.hindsight import score_hypotheses
from wildshape.records import SightLines, Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.simulate.sensor import DepthCamera

CONFIG = FreeSpaceConfig()


@pytest.fixture(scope="module")
def track() -> Track:
    """Two scans of a car that something hides in part."""
    config = SimulationConfig(tracks=1, scans=2, occlusion=0.999, far_m=15.0, rays=2048)
    (found,) = simulate_tracks(config, 7, workers=1)
    return found


def test_what_rays_passed_is_taken_off_and_the_object_stays(track: Track) -> None:
    sights = Sights(track.scans, track.rays, CONFIG)
    truth = torch.from_numpy(shape_of(track))
    longer = truth * torch.tensor((1.1, 1.0, 1.0))
    beyond = longer[:, 0].abs() > truth[:, 0].abs().max() + 0.1
    kept = without_free_space(truth, poses_of(track), sights)
    cut = without_free_space(longer, poses_of(track), sights)
    assert len(kept) > 0.97 * len(truth)
    assert (cut[:, 0].abs() > truth[:, 0].abs().max() + 0.1).sum() < 0.8 * beyond.sum()
    nowhere = stack([SE3(pose.rotation, -pose.translation) for pose in poses_of(track)])
    assert torch.equal(without_free_space(truth, nowhere, sights), truth)  # no ray passes there


def half_hidden() -> tuple[np.ndarray, np.ndarray, Sights]:
    """A plane, a scan beside it, and rays: a wall hides half of the plane, they pass the other."""
    y, z = np.meshgrid(np.linspace(-2, 2, 41), np.linspace(-1, 1, 21))
    plane = np.stack((np.full(y.size, 10.0), y.ravel(), z.ravel()), -1).astype(np.float32)
    ends = plane * np.where(plane[:, 1:2] > 0, 0.5, 2.0).astype(np.float32)
    scan = np.array([[10.0, 9.0, 0.0]] * 16, np.float32)
    return plane, scan, Sights([scan], [SightLines.of_returns(ends)], CONFIG)


def test_what_rays_of_any_scan_passed_is_taken_off() -> None:
    plane, scan, sights = half_hidden()
    ends = plane * np.where(plane[:, 1:2] < 1, 0.5, 2.0).astype(np.float32)
    rays = [*sights.rays, SightLines.of_returns(ends)]
    both = Sights([scan, scan], rays, replace(CONFIG, least_kept=0.0))
    kept = without_free_space(torch.from_numpy(plane), stack([SE3.identity()] * 2), both)
    above = kept[kept[:, 2] > -1 + CONFIG.low_m]
    assert -0.2 < float(above[:, 1].min()) < float(above[:, 1].max()) < 1.2
    assert len(above) > 100


def test_shape_in_free_space_costs_and_what_is_hidden_does_not(track: Track) -> None:
    """A wall stands in front of half of a plane; the other half is in the way of rays."""
    plane, scan, sights = half_hidden()
    centres = torch.tensor([[10.0, 0.0, 0.0]])
    posed, centred = (torch.from_numpy(one) - centres for one in (plane, scan))
    inputs = (centred[None], centres, posed[None, None], wildshape.load().settings.projection)
    plain, seen = score_hypotheses(*inputs), SeenScores(sights, torch.eye(3)[None])(*inputs)
    assert seen.free_space is not None
    assert float(seen.free_space) == pytest.approx(CONFIG.free_m * 0.5, rel=0.05)
    assert torch.equal(seen.observation, plain.observation)
    # The nearer half, y > 0, was nearer to the scan: without it the mean is larger.
    assert float(seen.projection) > float(plain.projection) + 0.5
    assert float(plain.cost(0.25)) == float(plain.observation + 0.25 * plain.projection)


def test_rays_of_which_none_need_agree_are_not_used() -> None:
    plane, _, sights = half_hidden()
    assert sights.of(plane, 0) is not None
    assert sights._replace(config=replace(CONFIG, nearest=0)).of(plane, 0) is None


def test_free_space_costs_each_hypothesis_its_own_however_the_scan_is_turned() -> None:
    """Of a wall over half of the view, as above: one shape is half behind it, one is all."""
    plane, scan, sights = half_hidden()
    behind = np.abs(plane) + np.array((0.0, 0.05, 0.0), np.float32)
    centre = torch.tensor((10.0, 0.0, 0.0))
    vector = torch.tensor((0.3, -0.2, 0.5))
    for turn in (torch.eye(3), rotation_from_vector(vector)):
        posed = torch.stack([torch.from_numpy(one) - centre for one in (plane, behind)]) @ turn.mT
        centred = (torch.from_numpy(scan) - centre) @ turn.mT
        inputs = (centred[None], (turn @ centre)[None], posed[None], PolarBins())
        seen = SeenScores(sights, turn[None])(*inputs)
        assert seen.free_space is not None
        half, none = seen.free_space[0].tolist()
        assert half == pytest.approx(CONFIG.free_m * 0.5, abs=0.05 * CONFIG.free_m)
        assert none == pytest.approx(0.0, abs=0.05 * CONFIG.free_m)
        paid = seen.cost(0.25) - (seen.observation + 0.25 * seen.projection)
        torch.testing.assert_close(paid, seen.free_space)


def test_what_a_shape_itself_hides_counts_no_more_with_rays_than_without() -> None:
    plane, scan, sights = half_hidden()
    centre = torch.tensor((10.0, 0.0, 0.0))
    scored = []
    for shape in (plane, np.concatenate((plane, plane * np.float32(1.3)))):
        centred, posed = (torch.from_numpy(one) - centre for one in (scan, shape))
        inputs = (centred[None], centre[None], posed[None, None], PolarBins())
        scored.append(float(SeenScores(sights, torch.eye(3)[None])(*inputs).projection))
    assert scored[1] == pytest.approx(scored[0], rel=1e-5)


def test_looks_one_by_one_keep_their_rays(track: Track) -> None:
    model = wildshape.load()
    rays = [track.rays[0], None]
    looked = model.look(track.scans, rays)
    again = Looked.joined([*looked.each()])
    assert list(again.rays) == rays
    pairs = zip(model.complete_looked(looked), model.complete_looked(again), strict=True)
    assert all(one.box == same.box for one, same in pairs)
    apart = [one.sights for one in looked.each()]
    assert [None if one is None else list(one.rays) for one in apart] == [rays[:1], rays[1:]]
    without = Looked.joined([*model.look(track.scans).each()])
    assert without.sights is None


def test_rays_may_be_handed_in_in_any_form_and_none_change_nothing(track: Track, tmp_path) -> None:
    model = wildshape.load()
    scan, rays = track.scans[0], track.rays[0]
    assert rays is not None
    write_rays(tmp_path / "r.npz", rays)
    parts = {"directions": rays.directions, "ranges": rays.ranges}
    forms = (rays, tmp_path / "r.npz", parts, tuple(parts.values()))
    done = [model.complete(scan, rays=form) for form in forms]
    assert all(np.array_equal(one.points, done[0].points) for one in done)
    assert all(one.box == done[0].box for one in done)
    alone = model.complete(scan)
    swallowed = replace(rays, ranges=np.full(len(rays), np.inf))  # nothing is known of these
    for none in (None, rays.part(np.zeros(0, int)), swallowed):
        same = model.complete(scan, rays=none)
        assert same.box == alone.box
        assert same.cost == pytest.approx(alone.cost)
    together = model.complete_track(track.scans, rays=track.rays)
    assert len(together) == 2
    (same,) = model.complete_many([scan], rays=None)
    assert same.box == alone.box
    refused(model.complete_track, track.scans, rays=[rays], match="1 sets of rays for 2 scans")
    refused(as_rays, 3, match="expected directions")
    refused(as_rays, (np.eye(3), ["a"]), match="rays: ranges are no array of numbers")


def test_rays_count_in_every_way_to_pose_a_track(track: Track) -> None:
    model = wildshape.load()
    scans, rays = list(track.scans), list(track.rays)
    alone = [model.complete(*one, rays=of) for one, of in zip(zip(scans), rays)]
    posed = model.poses(scans, rays=rays)
    for i, one in enumerate(alone):
        torch.testing.assert_close(posed[i].matrix, one.pose.matrix, atol=1e-3, rtol=0)
    first, second = scans
    pair = model.register(first, second, rays=rays)
    assert pair.confidence == pytest.approx(min(one.confidence for one in alone), abs=1e-3)
    assert pair.confidence != pytest.approx(model.register(first, second).confidence, abs=1e-4)
    fused = model.fuse(scans, rays=rays)
    moved = model.register_track(scans, rays=rays)[0].apply_numpy(scans[0])
    np.testing.assert_allclose(fused[: len(scans[0])], moved, atol=1e-5)


def test_a_box_leaves_out_what_stands_where_rays_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Through the last part of a completed car, of which its scan shows nothing."""
    model, cars = wildshape.load(), drive_by()
    T_object_sensor = poses_of(cars)[8].inverse()
    scan = cars.scans[8][T_object_sensor.apply_numpy(cars.scans[8])[:, 0] > -0.6]
    alone = model.complete(scan)
    along = alone.pose.inverse().apply_numpy(alone.points)[:, 0]
    rays = SightLines.of_returns(3 * alone.points[along < np.quantile(along, 0.15)])
    length = model.complete(scan, rays=rays).box.size[0]
    assert length < alone.box.size[0] - 0.2
    monkeypatch.setattr(single_scans, "without_free_space", lambda shape, *_: shape)
    assert length < model.complete(scan, rays=rays).box.size[0] - 0.05


@pytest.mark.parametrize("key_scans", [32, 3])
def test_rays_stay_beside_their_scans_in_every_batch(
    key_scans: int, track: Track, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One scan a batch, in every way to complete a track, short or long, and for its one shape."""
    scans, rays = [*track.scans] * 2, [track.rays[0], None, None, track.rays[1]]
    model = wildshape.load(config=InferenceConfig(track=TrackConfig(key_scans=key_scans)))
    look, cut = Predictor.look, complete_track.without_free_space
    looked, costs, held = [], [], []

    def looking(self, batch, beside=()):
        found = look(self, batch, beside)
        looked.extend(beside)
        costs.append(found.found.cost)
        return found

    def cutting(shape, poses, sights):
        held.extend(sights.rays)
        return cut(shape, poses, sights)

    monkeypatch.setattr(Predictor, "look", looking)
    monkeypatch.setattr(complete_track, "without_free_space", cutting)
    model.complete_track(scans, rays=rays)
    (at_once,) = costs
    assert held == rays
    monkeypatch.setattr(predictor, "BATCH", 1)
    for way in (model.complete_many, model.complete_checked, model.complete_track):
        looked.clear()
        costs.clear()
        assert len(list(way(scans, rays=rays))) == len(scans)
        assert looked == rays
        assert torch.cat(costs).tolist() == pytest.approx(at_once.tolist(), rel=1e-4)
    assert held == rays * 2
    assert len(list(model.complete_checked(scans, track=True, rays=rays))) == len(scans)
    assert held == rays * 3


def test_small_objects_are_held_against_rays_as_large_ones_are(track: Track) -> None:
    """A tenth of the size gives the same answer, for `unit` shrinks all lengths."""
    scan, rays = track.scans[0], track.rays[0]
    assert rays is not None
    shape = poses_of(track)[0].apply_numpy(shape_of(track) * np.float32(1.1))
    small = SightLines(rays.directions, rays.ranges / np.float32(10))
    large_sights = Sights.of_objects([scan], [rays], CONFIG, 1.0)
    small_sights = Sights.of_objects([scan / np.float32(10)], [small], CONFIG, 0.1)
    large, tenth = large_sights.of(shape, 0), small_sights.of(shape / np.float32(10), 0)
    assert large is not None
    assert tenth is not None
    assert large.free.any()
    assert (large.free == tenth.free).mean() > 0.99  # but for rounding
    assert (large.hidden == tenth.hidden).mean() > 0.99
    chair = wildshape.load("chair")
    sights = chair.look([scan], [rays]).sights
    assert sights is not None
    assert sights.config.within_m == pytest.approx(chair.settings.unit * CONFIG.within_m)
    assert chair.settings.unit < 0.3


def test_rays_do_not_take_the_confidence_of_a_depth_view() -> None:
    """It was fitted without rays: what a shape pays in free space is no sign of a bad fit there."""
    config = SimulationConfig(tracks=1, scans=4, sensor="depth-camera", category="chair")
    (views,) = simulate_tracks(config, 3, workers=1)
    model = wildshape.load("chair")
    behind = [beside_view(scan) for scan in views.scans]
    alone = list(model.complete_many(views.scans))
    seen = list(model.complete_many(views.scans, rays=behind))
    paid = model.look(views.scans, behind).found.cost.numpy() - [one.cost for one in seen]
    assert (paid > 0.001).any()  # some of a shape stands where a ray passed
    for plain, known in zip(alone, seen, strict=True):
        assert known.cost == pytest.approx(plain.cost, rel=0.2)
        assert known.confidence == pytest.approx(plain.confidence, abs=0.2)


def beside_view(scan: np.ndarray, wall: float = 4.0) -> SightLines:
    """The rays of the simulated camera's other pixels, to a wall behind the object."""
    camera = DepthCamera()
    at = np.floor(scan[:, :2] / scan[:, 2:] * camera.focal_px + camera.center_px).astype(int)
    free = np.ones((camera.size, camera.size), bool)
    free[at[:, 1].clip(0, camera.size - 1), at[:, 0].clip(0, camera.size - 1)] = False
    v, u = np.nonzero(free)
    away = (np.stack((u, v), 1) + 0.5 - camera.center_px) / camera.focal_px
    ends = wall * np.concatenate((away, np.ones((len(u), 1))), 1)
    return SightLines.of_returns(ends[:: len(ends) // 2048 + 1].astype(np.float32))
