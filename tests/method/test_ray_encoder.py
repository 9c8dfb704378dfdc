# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Networks that see the rays beside an object, too."""

from dataclasses import replace

import pytest
import torch
from tests.method.small import SMALL, settings

from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.method.network import ShapePoseNet
from wildshape.method.ray_encoder import RayConfig, RayEncoder
from wildshape.ops.threads import exact_on

SEEING = replace(SMALL, rays=RayConfig(count=6, widths=(8, 8, 16)))


@pytest.fixture
def network():
    torch.manual_seed(0)
    found = ShapePoseNet(SEEING).eval()
    assert found.rays is not None
    torch.nn.init.normal_(found.rays.change.weight)
    return found


def given(batch=3):
    generator = torch.Generator().manual_seed(1)
    scans, at = (torch.randn(batch, n, 3, generator=generator) for n in (40, 6))
    kinds = torch.eye(3)[torch.arange(6) % 3].expand(batch, 6, 3)
    return scans, torch.cat((at, kinds), dim=-1)


def test_before_training_rays_change_nothing():
    torch.manual_seed(0)
    network = ShapePoseNet(SEEING)
    scans, rays = given()
    assert torch.equal(network.encode(scans, None, rays), network.encode(scans))


def test_rays_change_the_code_whatever_their_order(network):
    scans, rays = given()
    with torch.no_grad():
        alone, seen = network.encode(scans), network.encode(scans, None, rays)
        assert not torch.allclose(alone, seen, atol=1e-3)
        torch.testing.assert_close(network.encode(scans, None, rays.flip(1)), seen)
        # Rows of zeros are no rays; a scan without any stays as it is.
        fewer = torch.cat((rays, torch.zeros(3, 4, 6)), dim=1)
        torch.testing.assert_close(network.encode(scans, None, fewer), seen)
        assert torch.equal(network.encode(scans, None, torch.zeros(3, 6, 6)), alone)
        assert torch.equal(network.encode(scans, None, torch.zeros(3, 0, 6)), alone)
        shapes = network(scans, None, rays)[0]
    torch.testing.assert_close(shapes, network.canonical(seen).detach())


def test_a_gradient_reaches_every_layer(network):
    scans, rays = given()
    network.train().encode(scans, None, rays).square().sum().backward()
    assert all(bool(weights.grad.any()) for weights in network.rays.parameters())


def test_the_pass_through_winning_rays_is_the_dense_one():
    """In value and in every gradient; of rays that repeat, are none, or light nothing, too."""
    torch.manual_seed(0)
    encoder = RayEncoder((8, 8, 16), 12).double()
    torch.nn.init.normal_(encoder.change.weight)
    with torch.no_grad():
        encoder.layer3.bias[:3] = -1e3
    rays = given(4)[1].double()
    rays[1, 2:] = 0.0
    rays[2] = 0.0
    rays[3, 4:] = rays[3, :2]
    rays[3, 2] = 0.0
    found = []
    for encode, threads in ((encoder, 1), (encoder.by_winners, 1), (encoder.by_winners, 3)):
        with exact_on(threads):
            code = encode(rays)
        loss = (code * torch.arange(1.0, 13.0)).sum()
        found.append([code.detach(), *torch.autograd.grad(loss, list(encoder.parameters()))])
    for dense, alone, spread in zip(*found):
        assert bool(dense.any())
        torch.testing.assert_close(alone, dense, rtol=0, atol=1e-12 * float(dense.abs().max()))
        assert torch.equal(spread, alone)


def test_training_on_a_cpu_and_inference_give_the_same_code(network):
    scans, rays = given()
    with torch.no_grad():
        dense = network.encode(scans, None, rays)
    found = network.train().encode(scans, "winners", rays)
    assert found.requires_grad
    torch.testing.assert_close(found.detach(), dense)


def test_a_checkpoint_keeps_it(network, tmp_path):
    path = tmp_path / "model.safetensors"
    save_checkpoint(path, network, replace(settings(), network=SEEING))
    loaded, found = load_checkpoint(path)
    assert found.network == SEEING
    scans, rays = given()
    assert torch.equal(loaded(scans, None, rays)[0], network(scans, None, rays)[0])
