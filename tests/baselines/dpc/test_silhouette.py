# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The best of DPC's candidates wins, alone is taught, and teaches the student."""

import pytest
import torch

from wildshape.baselines.dpc.silhouette import (
    Rendering,
    hindsight,
    image_costs,
    nearest,
    student_loss,
)
from wildshape.baselines.dpc.viewing_volume import (
    PinholeVolume,
    RangeImage,
    ahead,
    coarser,
    place,
    scan_image,
    to_volume,
)
from wildshape.geometry.transforms.rotation import quaternion_from_rotation, rotation_z

CAMERA = PinholeVolume()
OFFSET = torch.tensor([2.0, 2.0])


@pytest.fixture
def shape():
    """An L, flat before the camera, denser than pixels."""
    generator = torch.Generator().manual_seed(0)
    bars = torch.rand(2, 800, 3, generator=generator) - 0.5
    size = torch.tensor([[0.7, 0.12, 0.1], [0.12, 0.5, 0.1]])
    middle = torch.tensor([[0.0, 0.25, 0.0], [-0.29, 0.0, 0.0]])
    return (bars * size[:, None] + middle[:, None]).flatten(0, 1)


def posed(shape, angles):
    """The shape at these angles, `(views, candidates)`, before the camera."""
    return place(shape, rotation_z(angles), ahead(OFFSET, CAMERA)[:, None], CAMERA)


def seen(shape, angles):
    cloud = to_volume(posed(shape, angles[:, None])[:, 0], OFFSET, CAMERA)
    return coarser(scan_image(cloud, 32), 16)


@pytest.mark.parametrize("depth", [0.0, 1.0])
def test_the_candidate_nearest_to_the_truth_wins(shape, depth):
    truth = torch.tensor([0.4, 2.6])
    tried = torch.tensor([[2.0, 0.5, -1.2, 3.0], [0.0, -1.0, 1.5, 2.5]], requires_grad=True)
    rendering = Rendering(CAMERA, 16, 0.5, depth)
    found = hindsight(posed(shape, tried), OFFSET, seen(shape, truth), rendering, torch.ones(2))
    assert found.winner.tolist() == [1, 3]
    found.loss.backward()
    assert tried.grad is not None
    taught = tried.grad != 0
    assert taught.nonzero().tolist() == [[0, 1], [1, 3]]
    assert (tried.grad[taught] * (tried - truth[:, None])[taught] > 0).all()  # towards the truth


def test_cost_of_images_is_counted_by_hand():
    made = RangeImage(torch.zeros(1, 4, 4), torch.zeros(1, 4, 4))
    other = RangeImage(torch.zeros(1, 4, 4), torch.zeros(1, 4, 4))
    other.silhouette[0, 1, 2] = 1.0
    other.depth[0, 3, 3] = 0.5
    silhouette, depth = image_costs(made, other, 2.0)
    pixels = 64**2 / 4**2  # of the authors' images in one of ours
    assert silhouette.item() == pytest.approx(0.5 * pixels)
    assert depth.item() == pytest.approx(2.0 * 0.5 * pixels * 0.25)


def test_the_student_s_loss_is_a_squared_sine_and_knows_no_sign():
    angle = torch.tensor([0.3, 1.1])
    teacher = quaternion_from_rotation(rotation_z(angle)).requires_grad_()
    student = quaternion_from_rotation(rotation_z(torch.zeros(2))).requires_grad_()
    loss = student_loss(student, teacher)
    assert loss.item() == pytest.approx((torch.sin(angle / 2) ** 2).mean().item())
    assert student_loss(-student, teacher).item() == pytest.approx(loss.item())
    loss.backward()
    assert teacher.grad is None
    assert student.grad is not None


def test_the_candidate_at_the_least_angle_is_nearest_whatever_its_sign():
    quaternions = quaternion_from_rotation(rotation_z(torch.tensor([0.1, 1.0, 2.0])))
    signs = torch.tensor([1.0, -1.0, 1.0])[:, None]
    teacher = quaternion_from_rotation(rotation_z(torch.tensor([1.2, 0.3])))
    found = nearest((signs * quaternions).expand(2, -1, -1), teacher)
    assert torch.equal(found, torch.stack((-quaternions[1], quaternions[0])))
