# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a network is given of scans, and which hypothesis speaks: the cheapest."""

import numpy as np
import pytest
import torch
from tests.turned import SCAN, turned_scans

from wildshape.geometry.centring import box_centre, frustum_centre
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.sampling import drawn, sorted_points
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.method.choose_hypothesis import choose_hypothesis, network_input
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.multiview import LossConfig
from wildshape.method.ray_encoder import RayConfig


def test_a_network_sees_no_rays_from_another_side():
    """It made vehicles a metre too long by them."""
    scan = np.load(SCAN)
    ends = scan.mean(0) + np.random.default_rng(0).normal(0, 1.5, (60, 3))
    own = SightLines.of_returns(ends)
    beside = SightLines.of_returns(ends, np.full((60, 3), (0.0, 1.5, 0.3)))
    facing = SightLines.of_returns(ends, np.full((60, 3), 2 * scan.mean(0)))
    given = network_input([scan], 64, "lidar", facing=True)

    def seen(*parts):
        return given.beside([SightLines.joined(parts)], RayConfig()).rays

    assert torch.equal(seen(own, facing), seen(own))
    assert not torch.equal(seen(own, beside), seen(own))
    assert not seen(facing).any()


@torch.no_grad()
@pytest.mark.parametrize("belief", [0.0, 0.3])
def test_the_hypothesis_with_the_least_cost_less_belief_speaks(belief):
    predictor = load()
    of = predictor.settings
    given = network_input(turned_scans(5), of.input_points, of.sensor, of.facing)

    rule = LossConfig(beta=of.beta, projection=of.projection, belief=belief)
    found = choose_hypothesis(predictor.network, given.scans, given.centres, rule)
    for i in range(5):
        costs = []
        for k in range(found.poses.rotation.shape[1]):
            pose = SE3(found.poses.rotation[i, k], found.poses.translation[i, k])
            posed = pose.apply(found.shapes[i])[None, None]
            one = given.part(torch.tensor([i]))
            scores = score_hypotheses(one.scans, one.centres, posed, of.projection)
            costs.append(float(scores.cost(of.beta)))
        believed = np.array(costs) - belief * found.poses.log_belief[i].numpy()
        assert int(found.branch[i]) == int(believed.argmin())
        assert float(found.cost(of.beta)[i]) == pytest.approx(costs[int(found.branch[i])], abs=1e-5)


@pytest.mark.parametrize(
    ("sensor", "centre_of"), [("lidar", frustum_centre), ("camera", box_centre)]
)
def test_network_input_is_centred_and_the_centres_bring_it_back(sensor, centre_of):
    rng = np.random.default_rng(0)
    scans = [rng.normal((8, 1, -1), 1, (n, 3)).astype(np.float32) for n in (40, 300)]
    inputs, centres, turn, sizes, rays = network_input(scans, 64, sensor)
    assert rays.shape == (2, 0, 6)
    assert sizes.tolist() == [40, 64]
    assert torch.equal(turn, torch.eye(3).expand(len(scans), 3, 3))
    for i, points in enumerate(scans):
        torch.testing.assert_close(centres[i], centre_of(torch.from_numpy(points)))
        back = (inputs[i] + centres[i]).numpy()
        np.testing.assert_allclose(back, sorted_points(points)[drawn(len(points), 64)], atol=1e-6)
