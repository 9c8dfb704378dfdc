# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Targets go with their scans: turned, stretched and centred, the shape still lies on the scan."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.strategies import clouds, rotation_about

from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.projection.visibility import FacingBins, facing_bins
from wildshape.geometry.transforms.se3 import SE3
from wildshape.method.ray_encoder import RayConfig
from wildshape.training.batches import fused
from wildshape.training.batches.fused import (
    DrawConfig,
    FusedSampler,
    FusedTargets,
    both_ends,
    stretching,
    with_hidden,
)
from wildshape.training.batches.occlusion_augmentation import OcclusionConfig
from wildshape.training.batches.views import ViewConfig, ViewSampler

CONFIG = ViewConfig(tracks=3, views=4, points=300, turn="facing", roll=0.5)


def true_targets_of(store, cars):
    """The truth as targets, made by hand."""
    rotation = torch.cat([car.T_sensor_object.rotation for car in cars]).float()
    translation = torch.cat([car.T_sensor_object.translation for car in cars]).float()
    shapes = torch.stack([torch.from_numpy(car.shape) for car in cars])
    sensors = [car.T_sensor_object.inverse().translation[:5].float() for car in cars]
    ends = torch.full((len(cars),), 0.05)
    return FusedTargets(rotation, translation, shapes, torch.stack(sensors), ends, complete=True)


def sampler_of(store, cars, mirror=False, **changes):
    views = ViewSampler(store, np.arange(len(store)), replace(CONFIG, **changes))
    return FusedSampler(views, true_targets_of(store, cars), mirror=mirror)


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("turn", ["none", "yaw", "so3", "facing"])
def test_the_target_pose_carries_the_target_shape_onto_the_scan(car_store, cars, turn, mirror):
    batch = sampler_of(car_store, cars, mirror, turn=turn).draw(1, 2)
    assert torch.allclose(torch.linalg.det(batch.rotation), torch.ones(12), atol=1e-5)
    assert batch.scans.shape == (12, 300, 3)
    posed = SE3(batch.rotation, batch.translation).apply(batch.shapes)
    nearest = torch.cdist(batch.scans, posed).amin(2)
    # Points of the scans carry 2 cm of noise; 1024 points on a car lie some 10 cm apart.
    assert float(nearest.mean(1).max()) < 0.12
    plain = SE3(batch.rotation, batch.translation + 0.5).apply(batch.shapes)
    assert float(torch.cdist(batch.scans, plain).amin(2).mean(1).min()) > 0.15


def test_target_poses_are_rotations_and_cars_are_of_other_sizes(car_store, cars):
    batch = sampler_of(car_store, cars).draw(1, 2)
    eye = torch.eye(3).expand(12, 3, 3)
    torch.testing.assert_close(batch.rotation @ batch.rotation.mT, eye, atol=1e-5, rtol=0)
    torch.testing.assert_close(torch.linalg.det(batch.rotation), torch.ones(12))
    known = torch.stack([torch.from_numpy(np.ptp(car.shape, axis=0)) for car in cars])
    size = batch.shapes.amax(1) - batch.shapes.amin(1)
    factor = (size[:, None] / known).std(-1).amin(1)  # of the right car nearly the same on all axes
    assert float(factor.max()) < 0.13
    assert float((size[:, None] - known).abs().amax(-1).amin(1).mean()) > 0.02


def test_the_sensor_stays_where_it_was_seen_from(car_store, cars):
    """The place from which a scan was taken is a place of its track: at the batch's own origin."""
    sampler = sampler_of(car_store, cars, turn="none")
    one_place = sampler.targets.sensors[:, :1].expand(-1, 5, -1)
    rows = torch.from_numpy(np.asarray([scans[0] for scans in sampler.views.scans_of]))
    first = SE3(sampler.targets.rotation[rows], sampler.targets.translation[rows])
    torch.testing.assert_close(
        first.apply(one_place)[:, 0], torch.zeros(len(cars), 3), atol=1e-4, rtol=0
    )
    sampler.views.scans_of = [scans[:1] for scans in sampler.views.scans_of]
    batch = FusedSampler(sampler.views, sampler.targets).draw(4)
    centres = batch.scans.new_zeros(len(batch.scans), 3)
    seen = SE3(batch.rotation, batch.translation).apply(batch.sensors)
    hit = seen.norm(dim=-1).amin(1)  # from the scan's centre to its sensor
    closest = min(np.linalg.norm(car_store.scan_points(int(row)), axis=1).min() for row in rows)
    shrunk = np.exp(-0.2) * 0.92  # the smallest factor of `stretching`
    assert float(hit.min()) > shrunk * closest
    # The line from the sensor meets the scan: nothing of the shape is far in front of its points.
    unit = torch.nn.functional.normalize(centres - seen[:, 0], dim=-1)
    depth = ((batch.scans - seen[:, :1]) * unit[:, None]).sum(-1)
    assert bool((depth > 0).all())


@pytest.mark.parametrize("mirror", [False, True])
def test_sensors_are_stretched_and_reflected_with_their_scans(car_store, cars, mirror):
    """Seen by the scan that was taken there, a place is the origin: straight before the scan."""
    sampler = sampler_of(car_store, cars, mirror)
    firsts = [scans[:1] for scans in sampler.views.scans_of]
    place = sampler.targets.sensors[:, :1].expand(-1, 5, -1)
    sampler.views.scans_of = firsts
    batch = FusedSampler(
        sampler.views, sampler.targets._replace(sensors=place), mirror=mirror
    ).draw(1, 2)
    seen = SE3(batch.rotation, batch.translation).apply(batch.sensors)
    assert float(seen[..., 1:].abs().max()) < 1e-3
    # From there to the scan's middle is the range of the middle of its points.
    away = -seen[:, 0, 0]
    reach = (batch.scans + torch.stack((away, 0 * away, 0 * away), 1)[:, None]).norm(dim=2)
    torch.testing.assert_close((reach.amin(1) + reach.amax(1)) / 2, away, atol=1e-3, rtol=0)


def test_a_batch_depends_on_its_seeds_alone(car_store, cars):
    first, second = sampler_of(car_store, cars), sampler_of(car_store, cars)
    second.draw(9)
    for one, two in zip(first.draw(1, 5), second.draw(1, 5)):
        assert torch.equal(one, two)
    assert not torch.equal(first.draw(1, 5).scans, first.draw(1, 6).scans)


def stretched(seed):
    R = torch.stack([rotation_about((1, seed + 1, 2), 0.3 + seed), torch.eye(3).double()])
    factors = torch.tensor([[1.2, 0.9, 1.05], [0.8, 1.0, 1.1]], dtype=torch.float64)
    return R, factors, stretching(R, factors)


@pytest.mark.parametrize("seed", range(3))
def test_stretching_is_symmetric_and_along_the_objects_axes(seed):
    R, factors, by = stretched(seed)
    torch.testing.assert_close(by, by.mT)
    torch.testing.assert_close(by @ R, R * factors[:, None])
    same = stretching(R, torch.ones(2, 3, dtype=torch.float64))
    torch.testing.assert_close(same, torch.eye(3).double().expand(2, 3, 3))


@pytest.mark.parametrize("seed", range(3))
def test_stretching_keeps_what_hides_what(seed):
    """Points on a ray from the sensor stay on one ray, in the same order."""
    _, _, by = stretched(seed)
    near = clouds(seed, 2, 50, 3) + torch.tensor((8.0, 1.0, 0.5), dtype=torch.float64)
    far = near * (1.01 + torch.rand(2, 50, 1, dtype=torch.float64))
    front, behind = near @ by.mT, far @ by.mT
    ratio = behind / front
    torch.testing.assert_close(ratio, (far / near).expand_as(ratio))
    assert bool((behind.norm(dim=-1) > front.norm(dim=-1)).all())
    # Narrow bins hold a point and what it hides, before and after.
    for cloud, hidden in ((near, far), (front, behind)):
        both = torch.cat((cloud, hidden), dim=1)
        index = facing_bins(both, cloud.mean(1), FacingBins(0.25)).index
        assert float((index[:, :50] == index[:, 50:]).float().mean()) > 0.97


def test_half_of_the_scans_are_reflected_where_objects_are_symmetric(car_store, cars):
    plain = sampler_of(car_store, cars).draw(1, 2)
    mirrored = sampler_of(car_store, cars, mirror=True).draw(1, 2)
    turned = mirrored.scans * torch.tensor((1.0, -1.0, 1.0))
    same = [torch.equal(a, b) for a, b in zip(plain.scans, mirrored.scans)]
    reflected = [torch.equal(a, b) for a, b in zip(plain.scans, turned)]
    assert all(a != b for a, b in zip(same, reflected))
    assert any(same)
    assert any(reflected)


def test_the_end_of_the_view_is_stretched_with_the_object(car_store, cars):
    """What was seen at the end of the view lies there still, whatever the object's new size."""
    sampler = sampler_of(car_store, cars)
    own = 4.0 ** torch.arange(len(cars))  # of every car another, so that it can be told
    sampler.targets = sampler.targets._replace(view_top=own)
    batch = sampler.draw(1, 2)
    car = (batch.view_top.log2() / 2).round().long()
    factors = batch.shapes.amax(1) / sampler.targets.shapes[car].amax(1)
    steeper = factors[:, 2] / (factors[:, 0] * factors[:, 1]).sqrt()
    torch.testing.assert_close(batch.view_top, own[car] * steeper)
    assert float(steeper.std()) > 0.01


def test_from_one_end_only_one_end_is_seen():
    front, side, rear = (8.0, 3.0, 1.0), (1.0, -8.0, 1.0), (-9.0, 4.0, 1.0)
    places = ((front, side, rear), (front, side, front), (rear, side, side), (side, side, side))
    assert both_ends(torch.tensor(places)).tolist() == [True, False, False, False]


def test_tracks_that_saw_both_ends_are_drawn_three_times_as_often(car_store, cars):
    sampler = sampler_of(car_store, cars, tracks=200)
    sensors = torch.full_like(sampler.targets.sensors, 5.0)
    sensors[0, 0, 0], sensors[0, :, 1] = -5.0, 1.0
    own = 4.0 ** torch.arange(len(cars))
    targets = sampler.targets._replace(sensors=sensors, view_top=own)
    batch = FusedSampler(sampler.views, targets).draw(1, 2)
    drawn = torch.bincount((batch.view_top.log2() / 2).round().long(), minlength=len(cars))
    assert float(drawn[0] / drawn[1:].double().mean()) == pytest.approx(3.0, rel=0.3)


def test_scans_from_close_by_are_drawn_up_to_four_times_as_often(car_store, cars):
    """Twice as often from 8 m over the root of 2, four times from 4 m and less, alike beyond 8."""
    sampler = sampler_of(car_store, cars)
    scans = sampler.views.scans_of[0][:5]
    away = torch.tensor((20.0, 8.0, 8 / 2**0.5, 4.0, 1.0))
    placed = sampler.targets.translation.clone()
    placed[torch.from_numpy(scans)] = away[:, None] * torch.tensor((0.6, 0.8, 0.0))
    sampler = FusedSampler(sampler.views, sampler.targets._replace(translation=placed))
    shares = sampler._shares_in(scans)
    assert shares is not None
    np.testing.assert_allclose(shares / shares[0], (1, 1, 2, 4, 4), rtol=1e-5)
    assert abs(shares.sum() - 1) < 1e-12


def test_rays_go_with_their_scans(car_store, cars, monkeypatch):
    """Rays that end where the object's own points lie are seen where these are seen."""
    monkeypatch.setattr(
        car_store, "rays_of", lambda scan: SightLines.of_returns(car_store.scan_points(scan)[:64])
    )
    plain = sampler_of(car_store, cars, mirror=True, points=6000)  # nearly all are drawn
    whole = OcclusionConfig(strip=0.0, side=0.0, top=0.0, feet=0.0, rings=0.0)
    config = DrawConfig(without_rays=0.25, occlusion=whole)
    seeing = RayConfig(count=32, depth_m=9.0, within_m=9.0)
    sampler = FusedSampler(plain.views, plain.targets, config, mirror=True, rays=seeing)
    batches = [sampler.draw(3, step) for step in range(4)]
    rays, scans = (torch.cat([getattr(b, of) for b in batches]) for of in ("rays", "scans"))
    assert rays.shape == (48, 32, 6)
    known = rays[..., 3:].any(-1)
    without = ~known.any(1)
    assert 5 < int(without.sum()) < 20
    assert bool(known[~without].all())
    apart = torch.cdist(rays[~without][..., :3], scans[~without]).amin(2)
    assert float((apart < 1e-3).float().mean()) > 0.85


def test_of_merged_sensors_only_those_of_the_scan_s_own_side_are_seen(car_store, cars, monkeypatch):
    """Rays of a sensor on the object's other side are none, in training as when asked."""
    where = {"here": 0.0, "beyond": 2.0}
    plain = sampler_of(car_store, cars)
    whole = OcclusionConfig(strip=0.0, side=0.0, top=0.0, feet=0.0, rings=0.0)
    config = DrawConfig(without_rays=0.0, occlusion=whole)
    seeing = RayConfig(count=32, depth_m=9.0, within_m=9.0)
    for name, way in where.items():

        def rays_of(scan, way=way):
            points = car_store.scan_points(scan)[:64]
            return SightLines.of_returns(points, np.zeros_like(points) + way * points.mean(0))

        monkeypatch.setattr(car_store, "rays_of", rays_of)
        rays = FusedSampler(plain.views, plain.targets, config, rays=seeing).draw(3).rays
        assert bool(rays[..., 3:].any()) == (name == "here")


def test_networks_that_see_no_rays_are_drawn_none(car_store, cars):
    assert sampler_of(car_store, cars).draw(1).rays.shape == (12, 0, 6)


def test_what_is_hidden_now_ends_rays_before_it():
    rng, hidden = np.random.default_rng(0), torch.tensor([[8.0, 1.0, 0.0], [9.0, -1.0, 0.5]])
    rays = SightLines.of_returns(np.array([[30.0, 0.0, 0.0]], np.float32))
    found = with_hidden(rays, hidden, rng, 5)
    assert found.ranges[0] == 30
    assert len(found) == 3
    for direction, reach in zip(found.directions[1:], found.ranges[1:]):
        along = (hidden / hidden.norm(dim=1, keepdim=True)).numpy() @ direction
        at = int(along.argmax())
        assert along[at] == pytest.approx(1.0)
        assert reach < 0.81 * float(hidden[at].norm())
    assert with_hidden(rays, hidden[:0], rng, 5) is rays


def test_of_a_camera_s_views_nothing_is_hidden_and_all_are_drawn_alike(
    car_store, cars, monkeypatch
):
    def refuse(*_):
        raise AssertionError("hidden")

    monkeypatch.setattr(fused, "partly_hidden", refuse)
    sampler = sampler_of(car_store, cars, sensor="camera")
    assert sampler.draw(1).scans.shape == (12, 300, 3)
    assert sampler._shares_in(sampler.views.scans_of[0]) is None


def test_scans_are_rolled_about_their_line_of_sight(car_store, cars):
    """Up, as the turned scan has it: across the sight, little aside or to any side."""
    still = DrawConfig(larger=0.0, axis=0.0)
    for roll, least, most in ((0.0, 0.0, 1e-5), (1.0, 0.4, 1.0)):
        plain = sampler_of(car_store, cars, roll=roll, roll_rad=0.0)
        upright = torch.eye(3).expand_as(plain.targets.rotation)
        targets = plain.targets._replace(rotation=upright)
        up = FusedSampler(plain.views, targets, still).draw(1).rotation[:, :, 2]
        assert least <= float(up[:, 1].abs().max()) <= most


def test_rays_end_where_something_stands_before_a_part_of_the_scan(car_store, cars, monkeypatch):
    """A frame of one ray: whatever else is seen was put there with what hides."""
    first = car_store.scan_points(0)[:1]
    monkeypatch.setattr(car_store, "rays_of", lambda _: SightLines.of_returns(first))
    plain = sampler_of(car_store, cars)
    for strip in (0.0, 1.0):
        hides = OcclusionConfig(strip=strip, side=0.0, top=0.0, feet=0.0, rings=0.0)
        config = DrawConfig(without_rays=0.0, occlusion=hides)
        seeing = RayConfig(count=16, depth_m=90.0, within_m=90.0)
        rays = FusedSampler(plain.views, plain.targets, config, rays=seeing).draw(3).rays
        several = [len(some.unique(dim=0)) > 2 for some in rays]
        assert sum(several) == (0 if strip == 0.0 else pytest.approx(12, abs=2))
