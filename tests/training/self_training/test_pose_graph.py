# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A graph of exact registrations gives exact poses; wrong ones are left out; real scans gain."""

import pytest
import torch
from tests.cars import drive_by, poses_of

from wildshape.geometry.transforms.rotation import (
    rotation_from_quaternion,
    rotation_from_vector,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.training.self_training.pose_graph import (
    Edges,
    PoseGraphConfig,
    _twist,
    refine_by_graph,
    solve,
)


def shaken(poses, degrees=2.0, metres=0.15, seed=0):
    """Poses with an error of their own each, in the object's frame."""
    generator = torch.Generator().manual_seed(seed)
    vector = torch.randn(len(poses), 3, generator=generator, dtype=torch.float64)
    half = torch.deg2rad(degrees * vector) / 2
    turn = rotation_from_quaternion(torch.cat((torch.ones_like(half[:, :1]), half), dim=-1))
    shift = metres * torch.randn(len(poses), 3, generator=generator, dtype=torch.float64)
    return poses @ SE3(turn, shift)


def relative_error(found, truth):
    """Degrees and metres by which neighbours are off, at the object's origin: mean."""
    own = truth.inverse() @ found  # object frame to object frame
    apart = own[1:] @ own[:-1].inverse()
    turn = torch.rad2deg(apart.angle()).mean()
    return float(turn), float(apart.translation.norm(dim=-1).mean())


def exact_edges(poses, steps=(1, 3)):
    pairs = [(i, i + step) for step in steps for i in range(len(poses) - step)]
    source, target = torch.tensor(pairs).unbind(-1)
    return Edges(source, target, poses[target] @ poses[source].inverse())


def test_exact_registrations_leave_no_error_between_the_scans():
    truth = poses_of(drive_by(scans=9))
    turn, shift = relative_error(solve(shaken(truth), exact_edges(truth)), truth)
    assert turn < 0.25
    assert shift < 0.02
    # What all scans share stays as it was: the graph cannot know it.
    exact = solve(truth, exact_edges(truth))
    torch.testing.assert_close(exact.matrix, truth.matrix, atol=1e-6, rtol=0)


def test_a_registration_that_went_wrong_is_left_out():
    truth = poses_of(drive_by(scans=9))
    edges = exact_edges(truth)
    wrong = edges.T_target_source.translation.clone()
    wrong[4] += 2.0
    spoilt = edges._replace(T_target_source=SE3(edges.T_target_source.rotation, wrong))
    turn, shift = relative_error(solve(shaken(truth), spoilt), truth)
    assert turn < 0.3
    assert shift < 0.03


def test_some_registrations_that_went_a_little_wrong_are_left_out_in_the_end():
    """Believed at first, as all are while the poses are off."""
    truth = poses_of(drive_by(scans=12))
    edges = exact_edges(truth, steps=(1, 2, 3))
    wrong = edges.T_target_source.translation.clone()
    wrong[::6] += 0.3
    spoilt = edges._replace(T_target_source=SE3(edges.T_target_source.rotation, wrong))
    turn, shift = relative_error(solve(shaken(truth), spoilt), truth)
    assert turn < 0.3
    assert shift < 0.02


def test_poses_given_hold_against_a_registration_as_much_as_they_are_believed():
    """Two that are given alike, and said to lie apart, both to half a metre: a third each."""
    wide = PoseGraphConfig(edge_m=0.5, prior_m=0.5, widest=1e6, narrowest=1e6)
    apart = SE3.identity(1)
    apart = SE3(apart.rotation, torch.tensor([[0.3, 0.0, 0.0]], dtype=torch.float64))
    edges = Edges(torch.tensor([0]), torch.tensor([1]), apart)
    found = solve(SE3.identity(2), edges, wide)
    expected = torch.tensor([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]], dtype=torch.float64)
    torch.testing.assert_close(found.translation, expected)
    torch.testing.assert_close(found.rotation, SE3.identity(2).rotation)


@pytest.mark.parametrize("step", [1.0, 0.0])
def test_scans_are_laid_on_their_neighbours(step):
    """A parked car that is passed, and one that keeps its distance."""
    track = drive_by(scans=8, step=step, heading=0.4, side=5.0, points=600)
    truth = poses_of(track)
    start = shaken(truth, degrees=1.5, metres=0.08)
    before = relative_error(start, truth)
    after = relative_error(refine_by_graph(list(track.scans), start), truth)
    assert after[0] < 0.5 * before[0]
    assert after[1] < 0.5 * before[1]


def test_too_little_to_lay_on_each_other_changes_nothing():
    track = drive_by(scans=2, points=60)
    few = [scan[:10] for scan in track.scans]
    poses = poses_of(track)
    assert refine_by_graph(few, poses) is poses
    assert refine_by_graph(few[:1], poses[:1]) is not None


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.1])
def test_a_residual_is_in_radians_and_metres(angle):
    """So that what is trusted to half a degree and 3 cm weighs as such."""
    vector = angle * torch.tensor(((0.6, -0.48, 0.64),), dtype=torch.float64)
    shift = torch.tensor(((1.0, 2.0, 3.0),), dtype=torch.float64)
    found = _twist(SE3(rotation_from_vector(vector), shift))
    torch.testing.assert_close(found, torch.cat((vector, shift), -1), atol=1e-10, rtol=1e-9)
