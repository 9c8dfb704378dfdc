# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC's network and its checkpoint."""

from dataclasses import replace

import pytest
import torch

from wildshape.baselines.dpc.checkpoint import DpcSettings, is_dpc, load_dpc, save_dpc
from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.baselines.dpc.viewing_volume import PinholeVolume, PolarVolume, scan_image
from wildshape.errors import BadInputError

TINY = DpcConfig(image=16, voxels=8, points=20, channels=4, code=16, candidates=3)


def looked(config, count=2):
    torch.manual_seed(0)
    network = DpcNet(config).eval()
    image = scan_image(torch.rand(count, 30, 3) - 0.5, config.image)
    code = network.encode(image)
    return network, network.cloud(code), network.poses(code)


def test_what_comes_out():
    _, (cloud, strength), poses = looked(TINY)
    assert cloud.shape == (2, 20, 3)
    assert cloud.abs().max() <= 0.5
    assert ((strength > 0) & (strength < 1)).all()
    assert poses.candidates.shape == (2, 3, 4)
    torch.testing.assert_close(poses.candidates.norm(dim=-1), torch.ones(2, 3))
    torch.testing.assert_close(poses.student.norm(dim=-1), torch.ones(2))
    assert poses.translation.abs().max() == 0


def test_dagger_also_moves_but_not_far():
    _, _, poses = looked(replace(TINY, reach=0.15))
    assert 0 < poses.translation.abs().max() <= 0.15


def test_the_candidates_start_apart():
    _, _, poses = looked(TINY)
    between = (poses.candidates[:, 0] * poses.candidates[:, 1]).sum(-1).abs()
    assert between.max() < 0.99


@pytest.mark.parametrize("volume", [PinholeVolume(1.5, 1.2, 2.0), PolarVolume(8.0)])
def test_a_checkpoint_holds_all_of_it(volume, tmp_path):
    network, _, _ = looked(replace(TINY, volume=volume, reach=0.1))
    settings = DpcSettings(network.config, "dpc-dagger", 0.5, {"seed": 3}, half_turn=True)
    save_dpc(tmp_path / "dpc.safetensors", network, settings)
    assert is_dpc(tmp_path / "dpc.safetensors")
    again, found = load_dpc(tmp_path / "dpc.safetensors")
    assert found == settings
    image = scan_image(torch.zeros(1, 1, 3), TINY.image)
    assert torch.equal(again.encode(image), network.encode(image))


def test_other_files_are_refused_in_a_sentence(tmp_path):
    file = tmp_path / "other.safetensors"
    file.write_bytes(b"no checkpoint")
    assert not is_dpc(file)
    assert not is_dpc(tmp_path / "missing.safetensors")
    with pytest.raises(BadInputError, match="not a readable safetensors file"):
        load_dpc(file)
