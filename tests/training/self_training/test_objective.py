# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Loss against fused targets: zero at the truth, by hand, and equal to slow twins."""

import math

import pytest
import torch
from tests import naive
from tests.strategies import clouds, rotation_about

from wildshape.geometry.surface import mirrored
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.training.self_training.objective import one_side, pose_terms, seen_from, shape_terms


def box(half=(2.0, 0.9, 0.7), count=2000, seed=0):
    """Points all over the surface of a box about the origin."""
    generator = torch.Generator().manual_seed(seed)
    points = 2 * torch.rand(count, 3, generator=generator) - 1
    row, axis = torch.arange(count), torch.arange(count) % 3
    points[row, axis] = torch.where(points[row, axis] < 0, -1.0, 1.0)
    return points * torch.tensor(half)


def branches(*poses):
    """`(1, K, 3, 3)` and `(1, K, 3)` of `(rotation, translation)` pairs."""
    rotation = torch.stack([R.float() for R, _ in poses])[None]
    return rotation, torch.tensor([t for _, t in poses])[None]


def test_pose_terms_are_zero_at_the_truth_and_the_truth_wins():
    R, t = rotation_about((1, 2, 3), 0.7), (0.3, -0.2, 0.5)
    turned = rotation_about((1, 2, 3), 1.4)
    terms = pose_terms(
        *branches((turned, t), (R, t)), R[None].float(), torch.tensor([t]), box()[None]
    )
    assert int(terms.winner) == 1
    assert float(terms.distance) < 2e-6


def test_pose_terms_by_hand():
    """A shift moves all corners by its length; a quarter turn in yaw by sqrt(2) of the radius."""
    half, eye = (2.0, 1.0, 0.5), torch.eye(3)
    shape = torch.tensor(half) * torch.tensor(
        [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    )
    truth = (eye[None], torch.zeros(1, 3), shape[None])
    shifted = pose_terms(*branches((eye, (0.3, 0.0, 0.4))), *truth)
    assert float(shifted.distance) == pytest.approx(0.5, abs=1e-6)
    quarter = rotation_z(torch.tensor(math.pi / 2))
    turned = pose_terms(*branches((quarter, (0.0, 0.0, 0.0))), *truth)
    assert float(turned.distance) == pytest.approx(math.sqrt(2) * math.hypot(2.0, 1.0), abs=1e-5)


def test_strays_are_no_corners():
    """One point in a hundred flies far beyond the box on every axis."""
    shape, quarter = box(count=1000), rotation_z(torch.tensor(math.pi / 2))
    shape[::100] *= 20.0
    truth = (torch.eye(3)[None], torch.zeros(1, 3), shape[None])
    turned = pose_terms(*branches((quarter, (0.0, 0.0, 0.0))), *truth)
    assert float(turned.distance) == pytest.approx(math.sqrt(2) * math.hypot(2.0, 0.9), rel=0.05)


def test_the_winner_alone_learns():
    rotation, translation = branches(
        (torch.eye(3), (0.1, 0.0, 0.0)), (torch.eye(3), (0.5, 0.0, 0.0))
    )
    translation.requires_grad_()
    terms = pose_terms(rotation, translation, torch.eye(3)[None], torch.zeros(1, 3), box()[None])
    terms.distance.sum().backward()
    assert translation.grad is not None
    torch.testing.assert_close(translation.grad[0, 0], torch.tensor((1.0, 0.0, 0.0)))
    assert not bool(translation.grad[0, 1].any())


def test_no_gradient_is_infinite_at_the_truth():
    translation = torch.zeros(1, 1, 3, requires_grad=True)
    rotation = torch.eye(3)[None, None]
    terms = pose_terms(rotation, translation, rotation[:, 0], torch.zeros(1, 3), box()[None])
    terms.distance.sum().backward()
    assert translation.grad is not None
    assert bool(torch.isfinite(translation.grad).all())


def test_shape_terms_equal_the_double_loop():
    shapes, targets = clouds(1, 2, 30, 3).float(), clouds(2, 2, 41, 3).float()
    terms = shape_terms(shapes, targets, None)
    for i in range(2):
        there = naive.one_way(shapes[i], targets[i])
        back = naive.one_way(targets[i], shapes[i])
        assert float(terms.precision[i]) == pytest.approx(there, rel=1e-5)
        assert float(terms.coverage[i]) == pytest.approx(back, rel=1e-5)


def test_unknown_points_do_not_count_and_far_ones_little():
    shapes, targets = clouds(3, 2, 25, 3).float(), clouds(4, 2, 18, 3).float()
    known = torch.rand(2, 25, generator=torch.Generator().manual_seed(5)) < 0.6
    terms = shape_terms(shapes, targets, known)
    apart = torch.cdist(shapes, targets, compute_mode="donot_use_mm_for_euclid_dist")
    for i in range(2):
        near = apart[i].amin(1).clamp(max=0.4)[known[i]].mean()
        back = apart[i].amin(0).clamp(max=0.8).mean()
        assert float(terms.precision[i]) == pytest.approx(float(near), rel=1e-5)
        assert float(terms.coverage[i]) == pytest.approx(float(back), rel=1e-5)


def test_the_gradient_of_the_shape_terms_is_autograds():
    shapes, targets = clouds(6, 1, 20, 3).float().requires_grad_(), clouds(7, 1, 20, 3).float()
    terms = shape_terms(shapes, targets, None)
    (found,) = torch.autograd.grad((terms.precision + terms.coverage).sum(), shapes)
    apart = torch.cdist(shapes, targets, compute_mode="donot_use_mm_for_euclid_dist")
    (expected,) = torch.autograd.grad((apart.amin(2).mean() + apart.amin(1).mean()), shapes)
    torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("known", [None, 12])
def test_one_side_of_symmetric_clouds_has_the_terms_and_gradients_of_both(known):
    half = clouds(8, 2, 20, 3).float().requires_grad_()
    across = torch.tensor((1.0, -1.0, 1.0))
    targets = clouds(9, 2, 15, 3).float()
    both, theirs = (torch.cat((part, part * across), dim=1) for part in (half, targets))
    seen = None if known is None else (torch.arange(40) % 20 < known).expand(2, 40)
    whole, one = shape_terms(both, theirs, seen), shape_terms(*one_side(both, targets, seen))
    for found, expected in zip(one, whole):
        torch.testing.assert_close(found, expected)
        gradients = (
            torch.autograd.grad(term.sum(), half, retain_graph=True) for term in (found, expected)
        )
        torch.testing.assert_close(*(next(iter(g)) for g in gradients), atol=1e-5, rtol=1e-4)


def brute_force(shape, place, cell=0.25):
    """The nearest point of each direction from a place, one point after the other."""
    rays = (shape - place).double()
    return naive.visible(rays, rays.mean(0), naive.FacingBins(cell))


_NO_END = torch.full((1,), math.inf)


@pytest.mark.parametrize("seed", range(3))
def test_seen_from_equals_brute_force(seed):
    shape = box(count=400, seed=seed)
    sensors = torch.tensor([[6.0, -5.0, 1.5], [-7.0, 4.0, 2.0]])
    expected = sorted({i for place in sensors for i in brute_force(shape, place)})
    found = seen_from(shape[None], sensors[None], _NO_END, mirror=False)[0]
    assert torch.nonzero(found)[:, 0].tolist() == expected


def test_one_side_is_seen_and_with_a_mirror_both():
    shape, sensors = mirrored(box()[None])[0], torch.tensor([[0.5, -8.0, 0.5], [-0.5, -8.0, 0.5]])
    right, left = shape[:, 1] < -0.89, shape[:, 1] > 0.89
    one = seen_from(shape[None], sensors[None], _NO_END, mirror=False)[0]
    assert float(one[right].float().mean()) > 0.05
    assert float(one[left].float().mean()) < 0.01  # at the rim alone, between points
    both = seen_from(shape[None], sensors[None], _NO_END, mirror=True)[0]
    assert float(both[left].float().mean()) > 0.05
    assert bool((both | ~one).all())
    on_both_sides = mirrored(sensors[None])
    assert torch.equal(seen_from(shape[None], on_both_sides, _NO_END, mirror=False)[0], both)


def test_what_lies_above_the_end_of_the_view_was_not_seen():
    shape, sensors = box(count=4000), torch.tensor([[6.0, -5.0, 0.0], [-7.0, 4.0, 0.0]])
    every = seen_from(shape[None], sensors[None], _NO_END, mirror=False)[0]
    level = seen_from(shape[None], sensors[None], torch.zeros(1), mirror=False)[0]
    assert torch.equal(level, every & (shape[:, 2] <= 0))
    assert bool((every & (shape[:, 2] > 0)).any())
