# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Refinement against the scan: nearer in pose and size, never further, the same at every size."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from scipy.spatial import KDTree
from tests.cars import car_surface, drive_by, poses_of

from wildshape.geometry.sampling import voxel_thin
from wildshape.geometry.surface import mirrored
from wildshape.inference.config import InferenceConfig, RefineConfig
from wildshape.inference.predictor import load
from wildshape.inference.refine import (
    Fit,
    _allowed,
    drawn_to,
    fit_to_scans,
    padded,
    refine,
)
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SHAPE = car_surface(4000, seed=5)[0].astype(np.float32)
STRETCH = np.array((1.07, 0.96, 1.05), np.float32)
TRACK = drive_by(scans=9, step=2.0, heading=0.3)
SCANS = TRACK.scans


def turn(axis, degrees):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    a = np.radians(degrees)
    x, y, z = axis
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross


class One(NamedTuple):
    """A refined shape and its pose."""

    shape: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray


def refined(scan, shape, R, t, *, up=None, **options) -> One:
    """`refine` of a single scan."""
    level = None if up is None else torch.from_numpy(up)
    given = (torch.from_numpy(np.ascontiguousarray(part))[None] for part in (shape, R, t))
    done = refine([scan], *given, up=level, **options)
    return One(*(part[0].numpy() for part in done[:3]))


def spoilt(i, degrees=3.0, metres=0.08):
    """The true pose of a scan, a little off."""
    rng = np.random.default_rng(i)
    T = poses_of(TRACK)[i]
    off = rng.normal(size=3)
    R = T.rotation.numpy() @ turn(rng.normal(size=3), degrees)
    return R, T.translation.numpy() + metres * off / np.linalg.norm(off)


def pose_errors(i, R, t):
    T = poses_of(TRACK)[i]
    cosine = (np.trace(R.T @ T.rotation.numpy()) - 1) / 2
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))), np.linalg.norm(t - T.translation.numpy())


def test_pose_and_size_come_nearer():
    """Median over a track: what one scan cannot tell of one angle, another tells.

    Sides that no scan shows move with the size, too.
    """
    given, before, after = SHAPE / STRETCH, [], []
    for i, scan in enumerate(TRACK.scans):
        R, t = spoilt(i)
        found = refined(scan, given, R, t, mirror=True)
        size = np.ptp(found.shape, axis=0) / np.ptp(SHAPE, axis=0)
        apart = [np.linalg.norm(one - SHAPE, axis=1).mean() for one in (given, found.shape)]
        before.append((*pose_errors(i, R, t), np.abs(np.log(STRETCH)).mean(), apart[0]))
        errors = pose_errors(i, found.rotation, found.translation)
        after.append((*errors, np.abs(np.log(size)).mean(), apart[1]))
        np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-9)
    turned, moved, sized, apart = np.median(after, axis=0) / np.median(before, axis=0)
    assert turned < 0.4
    assert moved < 0.7
    assert sized < 0.7
    assert apart < 0.7


def test_the_network_s_answer_is_believed_as_much_as_is_said():
    """Of a plate that a scan sees 2 cm off: the mean of both places by their inverse variances."""
    config = RefineConfig(effective_points=1.0, error_m=0.1, prior_m=0.05)
    x, y = torch.meshgrid(*[torch.linspace(-2, 2, 41, dtype=torch.float64)] * 2, indexing="ij")
    plate = torch.stack((x.flatten(), y.flatten(), 0 * x.flatten()), 1)[None]
    seen = padded([plate[0, ::7] + torch.tensor((0.0, 0.0, 0.02))])
    fit = fit_to_scans(seen, plate, torch.eye(3)[None], torch.zeros(1, 3), config=config)
    scan, prior = config.error_m**-2, config.prior_m**-2
    assert float(fit.translation[0, 2]) == pytest.approx(0.02 * scan / (scan + prior), rel=0.05)


def test_a_perfect_answer_stays():
    T = poses_of(TRACK)[4]
    found = refined(TRACK.scans[4], SHAPE, T.rotation.numpy(), T.translation.numpy(), mirror=True)
    rotation, translation = pose_errors(4, found.rotation, found.translation)
    assert rotation < 0.3
    assert translation < 0.03
    surface = KDTree(car_surface(60_000, seed=7)[0])
    assert surface.query(found.shape)[0].mean() < 0.03
    np.testing.assert_allclose(np.ptp(found.shape, axis=0), np.ptp(SHAPE, axis=0), atol=0.06)


def test_nothing_moves_where_the_scan_is_elsewhere():
    R, t = spoilt(0)
    found = refined(TRACK.scans[0] + np.float32(40.0), SHAPE, R, t, mirror=True)
    np.testing.assert_allclose(found.rotation, R, atol=1e-3)
    np.testing.assert_allclose(found.translation, t, atol=1e-3)
    np.testing.assert_allclose(found.shape, SHAPE, atol=1e-2)


def test_a_level_sensor_tells_pitch_and_roll():
    """Of twenty points, and a shape that is not their own; the scans' true tilt is nothing."""
    up = np.array((0.0, 0.0, 1.0))

    def tilts(**level):
        few = (scan[:: len(scan) // 20] for scan in SCANS)
        given = ((scan, SHAPE / STRETCH, *spoilt(i)) for i, scan in enumerate(few))
        found = [refined(*one, mirror=True, **level) for one in given]
        return np.degrees([np.arccos(np.clip(one.rotation[2, 2], -1, 1)) for one in found])

    assert tilts(up=up).mean() < 0.85 * tilts().mean()
    assert tilts(up=up).max() < tilts().max()


def test_up_is_said_of_the_canonical_frame():
    """A frame that leans by two degrees is not stood upright."""
    lean = turn((0, 1, 0), 2.0)
    T = poses_of(TRACK)[4]
    R, t = T.rotation.numpy() @ lean, T.translation.numpy()
    found = refined(SCANS[4], SHAPE @ lean, R, t, mirror=True, up=lean[2])
    assert np.degrees(np.arccos(found.rotation[2] @ lean[2])) < 0.2


def test_a_sensor_held_askew_is_left_as_it_is():
    """Far from level nothing is known of it: the answer turns with the scan."""
    up, R, t = np.array((0.0, 0.0, 1.0)), *spoilt(3)
    askew = turn((1, 2, 0), 30.0)
    turned = (SCANS[3] @ askew.T.astype(np.float32), SHAPE, askew @ R, askew @ t)
    free, held = refined(*turned, mirror=True), refined(*turned, mirror=True, up=up)
    cosine = (np.trace(free.rotation.T @ held.rotation) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))) < 0.1


@pytest.mark.parametrize("scale", [0.1, 0.01])
def test_small_objects_are_refined_as_large_ones(scale):
    """A model car in all its lengths: the same rotation, everything else to scale."""
    diagonal = float(np.linalg.norm(np.ptp(SHAPE, axis=0)))
    R, t = spoilt(3)
    base = 4.0 / diagonal  # below the five metres from which lengths are fixed
    large, small = (
        refined(TRACK.scans[3] * s, SHAPE * s, R, t * s, mirror=True) for s in (base, base * scale)
    )
    np.testing.assert_allclose(small.rotation, large.rotation, atol=1e-4)
    np.testing.assert_allclose(small.translation, large.translation * scale, atol=1e-4 * scale)
    np.testing.assert_allclose(small.shape, large.shape * scale, atol=1e-3 * scale)


def test_a_batch_gives_what_each_scan_gives_alone():
    """Scans of many and of few points, beside each other or not."""
    starts = [spoilt(i) for i in range(4)]
    scans = [SCANS[0], SCANS[1][::9], SCANS[2], SCANS[3][::30]]
    shapes = torch.from_numpy(np.stack([SHAPE / STRETCH] * 4))
    R, t = (torch.from_numpy(np.stack(part)) for part in zip(*starts))
    together = refine(scans, shapes, R, t, mirror=True)
    for i, scan in enumerate(scans):
        alone = refined(scan, SHAPE / STRETCH, *starts[i], mirror=True)
        np.testing.assert_allclose(together.shapes[i], alone.shape, atol=1e-5)
        np.testing.assert_allclose(together.rotation[i], alone.rotation, atol=1e-6)


def test_half_of_a_mirrored_shape_tells_the_whole():
    """Points that are each other's reflections are worked on once; shuffled, they are not."""
    half = torch.from_numpy(SHAPE[SHAPE[:, 1] > 0] / STRETCH)[None]
    whole, order = mirrored(half)[0].numpy(), np.random.default_rng(0).permutation(2 * len(half[0]))
    start = spoilt(2)
    by_half = refined(SCANS[2], whole, *start, mirror=True)
    by_whole = refined(SCANS[2], whole[order], *start, mirror=True)
    np.testing.assert_allclose(by_half.rotation, by_whole.rotation, atol=1e-4)
    off = np.linalg.norm(by_half.shape[order] - by_whole.shape, axis=1)
    assert np.quantile(off, 0.99) < 2e-3  # voxels on the mirror plane belong to one side


@pytest.mark.parametrize("mirror", [False, True])
def test_only_what_was_seen_is_drawn(mirror):
    seen = SHAPE[SHAPE[:, 1] > 0.84] + np.array((0.0, 0.06, 0.0), np.float32)
    both = np.concatenate((seen, seen * np.array((1, -1, 1), np.float32))) if mirror else seen
    thin = padded([torch.from_numpy(voxel_thin(both, RefineConfig().voxel_m))])
    drawn = drawn_to(torch.from_numpy(SHAPE.astype(float))[None], thin)[0].numpy()
    moved = np.linalg.norm(drawn - SHAPE, axis=1)
    left, right = SHAPE[:, 1] > 0.84, SHAPE[:, 1] < -0.84
    middle = np.abs(SHAPE[:, 1]) < 0.3
    assert np.median(np.abs(drawn[left, 1] - 0.91)) < 0.02
    assert moved[middle].max() < 1e-9
    if mirror:
        assert np.median(np.abs(drawn[right, 1] + 0.91)) < 0.02
    else:
        assert moved[right].max() < 1e-9


def test_levelling_may_cost_a_trace_of_the_fit():
    """Alone, the network leans this scan by four degrees, and lies on it a trace better so."""
    predictor = load()
    *_, drive = simulate_tracks(SimulationConfig(tracks=2, scans=6), 1, workers=1)
    scan = drive.scans[1]
    assert predictor.up is not None
    leans = [
        float(np.degrees(np.arccos(found.pose.rotation.numpy()[2] @ np.array(predictor.up))))
        for found in (load(raw=True).complete(scan), predictor.complete(scan))
    ]
    assert leans[0] > 1.8
    assert leans[1] < min(1.4, 0.7 * leans[0])


def test_only_what_is_brought_level_may_lie_farther_from_its_scan():
    """Level, askew by 3 degrees, tilted on purpose by 8."""
    lean = torch.deg2rad(torch.tensor([0.5, 3.0, 8.0], dtype=torch.float64))
    still, half, edge = lean.new_zeros(3, 3), lean.new_ones(3, 3), lean.new_full((3,), 0.02)
    cos, sin, zero, one = lean.cos(), lean.sin(), 0 * lean, 0 * lean + 1
    turned = torch.stack((cos, zero, sin, zero, one, zero, -sin, zero, cos), 1).view(3, 3, 3)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    config = RefineConfig()
    allowed = _allowed(edge, Fit(turned, still, half), up, config)
    assert (allowed / edge).tolist() == pytest.approx([1.0, config.level_may_cost, 1.0])
    assert torch.equal(_allowed(edge, Fit(turned, still, half), None, config), edge)


def test_its_numbers_can_be_set_from_python():
    scan = np.load(Path(__file__).parents[2] / "examples" / "scan.npy")
    still = InferenceConfig(refine=RefineConfig(iterations=0))
    raw, unmoved, usual = load(raw=True), load(config=still), load()
    poses = [predictor.complete(scan).pose.matrix for predictor in (raw, unmoved, usual)]
    np.testing.assert_allclose(poses[1], poses[0], atol=1e-6)
    assert float((poses[2] - poses[0]).abs().max()) > 1e-3
