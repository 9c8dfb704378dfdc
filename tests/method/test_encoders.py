# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every point network that can be the encoder, and what two of them compute."""

from dataclasses import replace
from typing import get_args

import pytest
import torch
from tests.method.small import SMALL, settings
from tests.strategies import clouds
from torch.nn.functional import leaky_relu, relu

from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.method.encoders.dgcnn import EdgeConv
from wildshape.method.encoders.named import Backbone, encoder_of
from wildshape.method.encoders.neighbourhood import first_copies, nearest_distinct
from wildshape.method.encoders.pointnet2 import SetAbstraction, farthest_points
from wildshape.method.network import ShapePoseNet

EVERY = pytest.mark.parametrize("name", get_args(Backbone))


def encoder(name, seed=0):
    torch.manual_seed(seed)
    return encoder_of(name, (8, 12, 16, 24), neighbours=16, centres=(128, 32)).double()


@EVERY
@pytest.mark.parametrize("count", [1, 2, 20, 200])
def test_order_and_repetition_of_points_do_not_matter(name, count):
    net, points = encoder(name), clouds(2, 2, count, 3)
    code = net(points)
    assert code.shape == (2, 24)
    order = torch.randperm(count, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(net(points[:, order]), code, atol=1e-12, rtol=0)
    repeated = torch.cat((points[:, -1:].expand(-1, 40, -1), points, points[:, :17]), dim=1)
    torch.testing.assert_close(net(repeated), code, atol=1e-12, rtol=0)


@EVERY
def test_each_cloud_is_coded_on_its_own_and_a_new_point_matters(name):
    net, points = encoder(name), clouds(3, 4, 150, 3)
    alone = torch.cat([net(cloud[None]) for cloud in points])
    torch.testing.assert_close(net(points), alone, atol=1e-12, rtol=0)
    far = torch.cat((points, torch.full((4, 1, 3), 9.0, dtype=torch.float64)), dim=1)
    assert not torch.allclose(net(points), net(far))


@EVERY
def test_gradients_reach_every_weight_and_are_true(name):
    net, points = encoder(name), clouds(4, 2, 40, 3)
    weight = clouds(5, 2, 24)
    (net(points) * weight).sum().backward()
    for label, parameter in net.named_parameters():
        assert parameter.grad is not None, label
        assert float(parameter.grad.abs().max()) > 0, label
    step = {label: clouds(6, *p.shape) for label, p in net.named_parameters()}
    grads = {label: p.grad for label, p in net.named_parameters() if p.grad is not None}
    slope = sum(float((grad * step[label]).sum()) for label, grad in grads.items())
    values = []
    for size in (1e-6, -1e-6):
        moved = {label: p.detach() + size * step[label] for label, p in net.named_parameters()}
        values.append(float((torch.func.functional_call(net, moved, points) * weight).sum()))
    assert (values[0] - values[1]) / 2e-6 == pytest.approx(slope, rel=1e-5)


@EVERY
def test_a_network_with_it_is_saved_and_loaded(name, tmp_path):
    torch.manual_seed(0)
    described = replace(settings(), network=replace(SMALL, backbone=name))
    network = ShapePoseNet(described.network)
    save_checkpoint(tmp_path / "m.safetensors", network, described)
    loaded, found = load_checkpoint(tmp_path / "m.safetensors")
    assert found == described
    points = clouds(0, 2, 50, 3).float()
    with torch.no_grad():
        assert torch.equal(network.encode(points), loaded.encode(points))
        assert torch.equal(network.encode(points), network.encoder(points / SMALL.scale))
    # With a gradient, as in training, it is the same code.
    torch.testing.assert_close(network.encode(points).detach(), loaded.encode(points).detach())


@pytest.mark.parametrize("name", ["pointnet2", "dgcnn"])
def test_how_many_neighbours_count_is_a_number_of_the_network(name):
    torch.manual_seed(0)
    widths, centres = (8, 12, 16, 24), (128, 32)
    fewer, more = (encoder_of(name, widths, neighbours=n, centres=centres) for n in (2, 16))
    fewer.load_state_dict(more.state_dict())
    points = clouds(1, 1, 60, 3).float()
    assert not torch.allclose(fewer(points), more(points))


def test_edge_convolution_is_that_of_a_loop_over_edges():
    torch.manual_seed(0)
    layer, features = EdgeConv(5, 7, 16).double(), clouds(7, 2, 40, 5)
    distinct = torch.ones(2, 40, dtype=torch.bool)
    found = layer(features, distinct)
    index = nearest_distinct(features, features, distinct, 16)
    for b in range(2):
        for i in range(40):
            own = features[b, i]
            edges = [layer.own(own) + layer.near(features[b, j] - own) for j in index[b, i]]
            expected = leaky_relu(torch.stack(edges), 0.2).amax(0)
            torch.testing.assert_close(found[b, i], expected)


def test_set_abstraction_is_that_of_a_loop_over_neighbourhoods():
    torch.manual_seed(0)
    layer = SetAbstraction(4, 6, centres=5, neighbours=16).double()
    places, features = clouds(8, 1, 30, 3), clouds(9, 1, 30, 4)
    centres, found = layer(places, features)
    index = nearest_distinct(centres, places, first_copies(places), 16)
    for s, centre in enumerate(centres[0]):
        edges = []
        for j in index[0, s]:
            edge = torch.cat((places[0, j] - centre, features[0, j]))
            edges.append(relu(layer.edge2(relu(layer.edge1(edge)))))
        torch.testing.assert_close(found[0, s], torch.stack(edges).amax(0))


def test_farthest_points_are_each_the_farthest_from_those_before():
    points = clouds(10, 2, 50, 3)
    chosen = farthest_points(points, 20)
    for cloud, rows in zip(points, chosen.tolist()):
        assert len(set(rows)) == 20
        assert rows[0] == int(cloud.norm(dim=1).argmax())
        for n in range(1, 20):
            apart = torch.cdist(cloud, cloud[rows[:n]]).amin(1)
            assert rows[n] == int(apart.argmax())


def test_farthest_points_of_few_take_each_once_before_any_copy():
    points = clouds(11, 1, 6, 3).repeat(1, 4, 1)
    assert len({row % 6 for row in farthest_points(points, 10)[0, :6].tolist()}) == 6
    assert farthest_points(points[:, :3], 10).shape == (1, 3)
