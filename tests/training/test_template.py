# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import pytest
import torch
from tests.strategies import clouds, rotation_about

from wildshape.training.template import template_deviation


def test_hand_computed():
    """Two shapes of two points: the first pair 6 m apart (3 m off its mean), the second equal."""
    first = torch.tensor([[[1.0, 0.0, 0.0], [5.0, 5.0, 5.0]]])
    second = torch.tensor([[[1.0, 0.0, 6.0], [5.0, 5.0, 5.0]]])
    found = template_deviation(torch.cat((first, second)))
    assert float(found) == pytest.approx((3 + 0 + 3 + 0) / 4, abs=1e-6)


def test_equal_shapes_cost_nothing_and_have_a_finite_gradient():
    shapes = clouds(0, 1, 20, 3).float().repeat(4, 1, 1).requires_grad_()
    loss = template_deviation(shapes)
    loss.backward()
    assert float(loss.detach()) < 2e-6
    assert shapes.grad is not None
    assert shapes.grad.isfinite().all()


def test_a_turned_shape_pays():
    shape = clouds(1, 50, 3)
    turned = shape @ rotation_about((0.0, 0.0, 1.0), 3.1).T
    straight = torch.stack((shape, shape + 0.01))
    assert float(template_deviation(torch.stack((shape, turned)))) > 20 * float(
        template_deviation(straight)
    )


def test_gradcheck():
    shapes = clouds(2, 3, 4, 3).requires_grad_()
    assert torch.autograd.gradcheck(template_deviation, (shapes,))
