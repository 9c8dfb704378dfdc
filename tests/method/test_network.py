# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from tests.strategies import clouds

from wildshape.geometry.transforms.rotation import rotation_angle
from wildshape.method.network import NetworkConfig, ShapePoseNet

SMALL = {"encoder": (16, 24, 32, 48), "decoder": (32, 32), "pose": (24, 16), "points": 64}


def network(seed=0, **changes):
    torch.manual_seed(seed)
    return ShapePoseNet(NetworkConfig(**{**SMALL, **changes})).eval()


def scans(seed=0, batch=3):
    return clouds(seed, batch, 80, 3).float()


@pytest.mark.parametrize("mirror", [False, True])
def test_shapes_of_what_comes_out(mirror):
    shape, rotation, translation = network(mirror=mirror)(scans())[:3]
    assert shape.shape == (3, 64, 3)
    assert rotation.shape == (3, 4, 3, 3)
    assert translation.shape == (3, 4, 3)


def test_the_mirrored_shape_is_symmetric_in_its_plane():
    shape = network(mirror=True)(scans())[0]
    reflected = shape * torch.tensor([1.0, -1.0, 1.0])
    rows = {tuple(p) for p in shape[0].tolist()}
    assert rows == {tuple(p) for p in reflected[0].tolist()}
    assert len(rows) == 64
    plain = network(mirror=False)(scans())[0]
    assert not {tuple(p) for p in plain[0].tolist()} & {
        tuple(p) for p in (plain * torch.tensor([1.0, -1.0, 1.0]))[0].tolist()
    }


def test_rotations_are_proper():
    rotation = network()(5 * scans())[1].detach()
    eye = torch.eye(3).expand_as(rotation)
    torch.testing.assert_close(rotation @ rotation.mT, eye, atol=1e-5, rtol=0)
    assert float(torch.linalg.det(rotation).min()) > 0.999


@pytest.mark.parametrize("branches", [2, 4])
def test_branches_start_spread_evenly_in_yaw(branches):
    net = network(branches=branches)
    with torch.no_grad():
        net.pose.weight3.zero_()
        rotation = net(scans())[1][0]
    turns = [math.degrees(float(rotation_angle(rotation[0].mT @ R))) for R in rotation]
    expected = [min(k * 360 / branches, 360 - k * 360 / branches) for k in range(branches)]
    assert turns == pytest.approx(expected, abs=1e-2)
    torch.testing.assert_close(rotation[:, 2, 2], torch.ones(branches))


def test_branches_spread_over_the_sphere_start_the_same_whatever_the_seed():
    first, second = network(0, spread="sphere"), network(1, spread="sphere")
    assert torch.equal(first.pose.bias3, second.pose.bias3)


def test_order_and_repetition_of_points_do_not_matter():
    net, points = network(), scans()
    for changed in (points.flip(1), torch.cat((points, points[:, :30]), dim=1)):
        for a, b in zip(net(points), net(changed)):
            torch.testing.assert_close(a, b, atol=1e-6, rtol=0)


def test_scale_is_the_unit_of_the_network():
    """With scale s, a scan s times as large gives a shape and translations s times as large."""
    one, two = network(3, scale=1.0), network(3, scale=2.5)
    shape, rotation, translation = one(scans())[:3]
    larger = two(2.5 * scans())
    torch.testing.assert_close(larger[0], 2.5 * shape, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(larger[1], rotation, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(larger[2], 2.5 * translation, atol=1e-4, rtol=1e-4)


def test_with_and_without_a_graph_the_code_is_the_same():
    net, points = network(), scans()
    trained = net.encode(points)
    assert trained.requires_grad
    with torch.no_grad():
        torch.testing.assert_close(net.encode(points), trained.detach(), atol=1e-5, rtol=1e-5)


def test_apply_and_choose():
    net = network()
    with torch.no_grad():
        code = net.encode(scans())
        poses, shape = net.poses(code), net.canonical(code)
    posed = poses.apply(shape)
    expected = shape[1] @ poses.rotation[1, 2].T + poses.translation[1, 2]
    torch.testing.assert_close(posed[1, 2], expected)
    branch = torch.tensor([3, 2, 0])
    torch.testing.assert_close(poses.choose(branch).apply(shape)[1, 0], posed[1, 2])


def test_defaults_are_the_paper_network():
    """METHOD 3: 3-128-256 and 512-512-1024, decoder 1024-1024-1024-3m, m 2048, K 4."""
    config = NetworkConfig()
    assert config.encoder == (128, 256, 512, 1024)
    assert config.decoder == (1024, 1024)
    assert (config.points, config.branches, config.mirror, config.scale) == (2048, 4, False, 1.0)
