# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track of a known car, its poses spoilt a little: they come back, and nothing else moves."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.cars import drive_by, poses_of
from tests.inference.tracks.spoilt import spoilt

from wildshape.inference.config import TrackConfig
from wildshape.inference.tracks import joint_icp
from wildshape.inference.tracks.joint_icp import (
    Surface,
    _counterparts,
    _disagreement,
    fused_surface,
    key_scans,
    refine_checked,
    refine_jointly,
    sampled,
    surest,
    surface_normals,
    taken_once,
)

BOXY = drive_by(scans=9, step=2.0, heading=0.3, side=5.0)
BODY, CABIN, SHIFT = np.array((2.1, 0.9, 0.7)), np.array((1.0, 0.75, 0.6)), (-0.4, 0.0, 0.6)
FINE = TrackConfig().fine
LONG = replace(FINE, rounds=30, widest_m=0.5)  # from poses that are off by decimetres


def round_car(count, rng):
    """An ellipsoid with another one on top, nowhere flat: points and outward normals."""
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    cabin = (rng.random(count) < 0.35)[:, None]
    points = np.where(cabin, unit * CABIN + SHIFT, unit * BODY)
    inside_body = ((points / BODY) ** 2).sum(1) < 1
    inside_cabin = (((points - SHIFT) / CABIN) ** 2).sum(1) < 1
    outside = ~np.where(cabin[:, 0], inside_body, inside_cabin)
    return points[outside], np.where(cabin, unit / CABIN, unit / BODY)[outside]


def seen(pose, seed, count=700):
    """What a sensor sees of it, with 3 mm of noise."""
    rng = np.random.default_rng(seed)
    points, normals = round_car(12 * count, rng)
    R, t = pose.rotation.numpy(), pose.translation.numpy()
    at = points @ R.T + t
    facing = at[((normals @ R.T) * at).sum(1) < 0][:count]
    return (facing + rng.normal(scale=0.003, size=facing.shape)).astype(np.float32)


TRUE = poses_of(BOXY)
SCANS = [seen(TRUE[i], i) for i in range(len(TRUE))]


def off(found, true):
    """Largest rotation in degrees, and largest way of the object's centre in metres."""
    error = true.inverse() @ found
    return float(torch.rad2deg(error.angle()).max()), float(error.translation.norm(dim=-1).max())


@pytest.mark.parametrize("seed", [1, 2])
def test_poses_spoilt_a_little_come_back(seed):
    """Every scan to half a degree, the median scan to 2.5 cm, as the middle scan sees it."""
    start = spoilt(TRUE, seed=seed)
    refined = refine_jointly(SCANS, start, mirror=False, config=LONG)
    middle = len(TRUE) // 2
    error = [TRUE.inverse() @ TRUE[middle] @ T[middle].inverse() @ T for T in (start, refined)]
    degrees = [float(torch.rad2deg(e.angle()).max()) for e in error]
    metres = [float(e.translation.norm(dim=-1).median()) for e in error]
    assert degrees[0] > 4.0
    assert metres[0] > 0.2
    assert degrees[1] < 0.5
    assert metres[1] < 0.025


@pytest.mark.parametrize("seed", [1, 2])
def test_scans_of_few_points_come_back_too(seed):
    """Each is taken several times over: points on top of each other would make planes of no use."""
    few, middle = [scan[:60] for scan in SCANS], len(TRUE) // 2
    T = refine_jointly(few, spoilt(TRUE, seed=seed), mirror=False, config=LONG)
    error = TRUE.inverse() @ TRUE[middle] @ T[middle].inverse() @ T
    assert float(torch.rad2deg(error.angle()).max()) < 3.0
    assert float(error.translation.norm(dim=-1).median()) < 0.08


def test_true_poses_stay():
    degrees, metres = off(refine_jointly(SCANS, TRUE, mirror=True, config=FINE), TRUE)
    assert degrees < 0.5
    assert metres < 0.02


def test_the_mirror_plane_is_kept():
    """Poses spoilt each in its own way: the plane y = 0 stays the car's own, on average."""
    start = spoilt(TRUE, seed=1)
    error = TRUE.inverse() @ refine_jointly(SCANS, start, mirror=True, config=LONG)
    asked = TRUE.inverse() @ start
    aside = float(error.translation[:, 1].mean().abs())
    assert aside < float(asked.translation[:, 1].mean().abs()) + 0.02
    yaw = torch.rad2deg(error.rotation[:, 1, 0].asin())
    assert abs(float(yaw.mean())) < 2.0


@pytest.mark.parametrize("mirror", [False, True])
def test_the_object_stays_where_it_was_on_average(mirror):
    """Its points' mean does not move, nor does the mean rotation, in what no scan can tell."""
    start = spoilt(TRUE, seed=2)
    refined = refine_jointly(SCANS, start, mirror=mirror)
    means = [
        torch.stack(
            [
                T[i].inverse().apply(torch.from_numpy(c).double()).mean(0)
                for i, c in enumerate(SCANS)
            ]
        ).mean(0)
        for T in (start, refined)
    ]
    way = (means[1] - means[0]).abs()
    free = way[[0, 2]] if mirror else way
    assert float(free.max()) < 0.015  # of the points drawn it is exactly the mean
    mean = (start.rotation.mT @ refined.rotation).mean(0)
    turned = torch.rad2deg(torch.atan2(mean[0, 2] - mean[2, 0], mean[0, 0] + mean[2, 2]))
    assert abs(float(turned)) < 0.3


def test_one_scan_is_left_alone():
    pose = TRUE[:1]
    assert refine_jointly(SCANS[:1], pose, mirror=True) is pose


def test_of_more_scans_than_points_each_has_one():
    """Over 16,384 scans none had any, and the search for neighbours was told of a k of 0."""
    few = replace(FINE, most=len(SCANS) - 1)
    assert len(refine_jointly(SCANS, TRUE, mirror=True, config=few).rotation) == len(SCANS)


def test_the_same_result_every_time():
    start = spoilt(TRUE, seed=3)
    first, second = (refine_jointly(SCANS, start, mirror=True) for _ in range(2))
    assert torch.equal(first.matrix, second.matrix)
    assert first.rotation.dtype == torch.float64


def test_the_normals_of_a_plane_and_a_sphere():
    generator = torch.Generator().manual_seed(4)
    plane = torch.rand(400, 3, generator=generator) * torch.tensor((1.0, 1.0, 0.0))
    assert float(surface_normals(plane)[:, 2].abs().min()) > 0.999
    sphere = 2 * torch.nn.functional.normalize(torch.randn(4000, 3, generator=generator), dim=1)
    cosine = (surface_normals(sphere) * sphere / 2).sum(1).abs()
    assert float(cosine.mean()) > 0.99


def test_points_taken_again_say_nothing_about_a_plane():
    """Scans of 9 and more points, each taken until there are 100."""
    small = [scan[: 9 + i] for i, scan in enumerate(SCANS)]
    points = TRUE.to(torch.float32).inverse().apply(torch.from_numpy(sampled(small, 100)))
    once = taken_once(small, 100)
    assert once.sum(1).tolist() == [len(scan) for scan in small]
    found = surface_normals(points.flatten(0, 1), distinct=once.flatten()).view_as(points)
    assert torch.equal(found[once], surface_normals(points[once]))
    assert torch.equal(found[0, :9], found[0, 90:99])


def test_the_surer_half_and_all_that_are_nearly_as_sure():
    odds = torch.tensor([1.0, 5.0, 3.0, 2.0, 4.0])
    assert surest(odds, share=0.9).tolist() == [1, 2, 4]
    assert surest(odds, share=0.3).tolist() == [1, 2, 3, 4]
    assert surest(torch.tensor([9.0, 0.1]), share=0.9).tolist() == [0, 1]
    assert surest(torch.ones(3), share=0.9).tolist() == [0, 1, 2]


@pytest.mark.parametrize("mirror", [False, True])
def test_no_scan_is_laid_on_itself_nor_on_its_own_reflection(mirror):
    """Near the mirror plane that is the nearest."""
    x, z = torch.meshgrid(torch.arange(5.0), torch.arange(4.0), indexing="ij")
    places = (torch.full((20,), y) for y in (0.1, 0.4, 0.8))
    sheets = torch.stack([torch.stack((x.flatten(), y, z.flatten()), 1) for y in places])
    onto = torch.tensor([0, 2])
    surface = Surface(sheets[onto], torch.zeros_like(sheets[onto]))
    found, at = _counterparts(sheets, surface, onto, mirror)
    # Scan 0 on scan 2; scan 1, nearer to scan 0, on that; scan 2 on scan 0.
    assert (at // 20 % 2).tolist() == [[1] * 20, [0] * 20, [0] * 20]
    assert len(found.points) == (80 if mirror else 40)


@pytest.mark.parametrize("mirror", [False, True])
def test_of_what_key_scans_show_there_is_a_reflection_too(mirror):
    config = TrackConfig().onto
    found = fused_surface(SCANS[:2], TRUE[:2], config, mirror=mirror)
    assert len(found.points) == len(found.normals) == config.most * (2 if mirror else 1)
    scan = TRUE[0].inverse().apply(torch.from_numpy(SCANS[0]).double()).float()
    assert float(torch.cdist(found.points[:100], scan).amin(1).max()) < 2e-3
    if mirror:
        for part in found:
            own, other = part.chunk(2)
            torch.testing.assert_close(other, own * torch.tensor((1.0, -1.0, 1.0)))


def test_scans_of_either_side_agree_where_objects_are_symmetric():
    """The sides of a wall each: its reflection is the other's; else they lie as far as counts."""
    x, z = np.meshgrid(np.linspace(-2, 2, 21), np.linspace(0, 1, 6))
    left = np.stack((x.ravel(), np.full(x.size, 0.9), z.ravel()), 1).astype(np.float32)
    sides = [left, left * np.array((1, -1, 1), np.float32)]
    poses, config = TRUE[:2], TrackConfig()
    scans = [poses[i].apply_numpy(side) for i, side in enumerate(sides)]
    assert _disagreement(scans, poses, True, config) < 1e-4
    assert _disagreement(scans, poses, False, config) == pytest.approx(config.vote.far_m)


FEW = TrackConfig(key_scans=4)
KEYS = key_scans(len(TRUE), FEW)


def test_of_a_long_track_no_scan_leaves_its_vote_far_behind(monkeypatch):
    """The key scans find the truth; on what they show, one of the others would jump."""
    start, asked = spoilt(TRUE, seed=1), []

    def onto(_surface, _scans, poses, _config):
        translation = poses.translation.clone()
        translation[1] += 9.0
        translation[2] += 0.1
        return replace(poses, translation=translation)

    def chosen(odds, share):
        asked.append(odds.tolist())
        return surest(odds, share)

    monkeypatch.setattr(joint_icp, "refine_jointly", lambda *_, **__: TRUE[KEYS])
    monkeypatch.setattr(joint_icp, "refine_onto", onto)
    monkeypatch.setattr(joint_icp, "surest", chosen)
    odds = torch.arange(1.0, len(TRUE) + 1)
    fit = refine_checked(SCANS, start, odds, mirror=False, config=FEW)
    assert fit.refined
    assert asked == [odds[KEYS].tolist()]
    assert torch.equal(fit.T_sensor_object[KEYS].matrix, TRUE[KEYS].matrix)
    moved = fit.T_sensor_object.translation - start.translation
    assert torch.equal(moved[1], torch.zeros(3).double())
    torch.testing.assert_close(moved[2], torch.full((3,), 0.1).double())


def test_of_a_long_track_none_moves_where_the_key_scans_do_not(monkeypatch):
    worse = spoilt(TRUE, seed=5, degrees=10.0, metres=0.4)
    monkeypatch.setattr(joint_icp, "refine_jointly", lambda *_, **__: worse[KEYS])
    monkeypatch.setattr(joint_icp, "refine_onto", lambda *_: worse)
    fit = refine_checked(SCANS, TRUE, mirror=False, config=FEW)
    assert not fit.refined
    assert fit.T_sensor_object is TRUE
