# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A widened network gives the same answers, and what was added can learn."""

from dataclasses import replace

import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.models.shapepose import NetworkConfig, ShapePoseNet
from wildshape.models.widen import can_widen, widened

SMALL = NetworkConfig(
    encoder=(8, 12, 16, 20), decoder=(14, 18), pose=(10, 6), points=32, branches=3, mirror=True
)
WIDE = replace(SMALL, encoder=(9, 24, 17, 33), decoder=(20, 18), pose=(15, 7))


def trained(config: NetworkConfig) -> ShapePoseNet:
    """A network all of whose weights matter, those of a fresh one's last layers too."""
    torch.manual_seed(3)
    network = ShapePoseNet(config)
    with torch.no_grad():
        for weight in network.parameters():
            weight.add_(0.2 * torch.randn(weight.shape))
    return network


@pytest.mark.parametrize("selector", [True, False])
def test_answers_are_those_of_the_narrow_network(selector):
    narrow = trained(replace(SMALL, selector=selector))
    wide = widened(narrow, replace(WIDE, selector=selector))
    scans = torch.randn(5, 40, 3)
    for mine, theirs in zip(wide(scans), narrow(scans), strict=True):
        torch.testing.assert_close(mine, theirs)


def test_what_was_added_is_listened_to_after_a_step():
    network = widened(trained(SMALL), WIDE)
    encoder, shape = network.encoder, network.shape
    heard = {  # by old outputs, of new inputs
        "join_point": encoder.join_point.weight[:16, 12:],
        "join_pooled": encoder.join_pooled.weight[:16, 12:],
        "point4": encoder.point4.weight[:20, 16:],
        "shape1": shape.layer1.weight[:14, 20:],
        "shape2": shape.layer2.weight[:, 14:],
        "pose1": network.pose.layer1.weight.unflatten(0, (3, 15))[:, :10, 20:],
        "pose2": network.pose.weight2[:, 10:, :6],
        "pose3": network.pose.weight3[:, 6:],
    }
    assert all((part == 0).all() for part in heard.values())
    poses = network(torch.randn(64, 40, 3))
    loss = poses[0].square().mean() + poses[1][..., 0, 1].mean() + poses[2].square().mean()
    loss.backward()
    torch.optim.SGD(network.parameters(), 1.0).step()
    for name, part in heard.items():
        units = part.movedim(-2 if name in ("pose2", "pose3") else -1, 0).flatten(1)
        rank = torch.linalg.matrix_rank(units.detach() / units.detach().abs().max())
        assert rank >= min(2, len(units)), f"{name}: units that are added do not learn alike"


@pytest.mark.parametrize(
    "other",
    [
        replace(WIDE, points=64),
        replace(WIDE, branches=4),
        replace(WIDE, encoder=(7, 24, 17, 33)),
        replace(WIDE, backbone="dgcnn"),
    ],
)
def test_nothing_but_more_width_is_taken(other):
    assert can_widen(SMALL, WIDE)
    assert not can_widen(SMALL, other)
    with pytest.raises(BadInputError, match="no wider form"):
        widened(trained(SMALL), other)
