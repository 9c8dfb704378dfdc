# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import json

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from tests.method.small import SMALL, settings
from tests.strategies import clouds

from wildshape.errors import BadInputError
from wildshape.geometry.projection.visibility import FacingBins, PixelBins, PolarBins
from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.method.network import ShapePoseNet


@pytest.fixture
def network():
    torch.manual_seed(0)
    return ShapePoseNet(SMALL)


@pytest.fixture
def saved(network, tmp_path):
    path = tmp_path / "model.safetensors"
    save_checkpoint(path, network, settings())
    return path


def rewritten(path, *, metadata=None, drop=(), add=None):
    """The same file with some things changed."""
    with safe_open(path, framework="pt") as file:
        found = dict(file.metadata())
        weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    weights = {k: v for k, v in weights.items() if k not in drop} | (add or {})
    texts = {**found, **(metadata or {})}
    save_file(weights, path, {key: text for key, text in texts.items() if text is not None})
    return path


@pytest.mark.parametrize(
    "projection", [PolarBins(0.01, 0.03), FacingBins(0.3), PixelBins(0.02, flat=True)]
)
def test_round_trip(network, tmp_path, projection):
    path = tmp_path / "deep" / "model.safetensors"
    save_checkpoint(path, network, settings(projection))
    loaded, found = load_checkpoint(path)
    assert found == settings(projection)
    assert not loaded.training
    points = clouds(0, 2, 50, 3).float()
    with torch.no_grad():
        for a, b in zip(network(points), loaded(points)):
            assert torch.equal(a, b)


def test_a_checkpoint_from_before_a_number_was_a_field_means_its_default(saved):
    with safe_open(saved, framework="pt") as file:
        described = json.loads(file.metadata()["settings"])
    for name in ("neighbours", "centres"):
        del described["network"][name]
    rewritten(saved, metadata={"settings": json.dumps(described), "sha256": None})
    assert load_checkpoint(saved)[1] == settings()


def test_unlimited_extent_survives(network, tmp_path):
    open_ended = dataclasses.replace(settings(), extent_m=(0.0, float("inf")))
    save_checkpoint(tmp_path / "m.safetensors", network, open_ended)
    assert load_checkpoint(tmp_path / "m.safetensors")[1] == open_ended


def test_half_is_half_as_large_and_nearly_the_same(network, saved, tmp_path):
    half = tmp_path / "half.safetensors"
    save_checkpoint(half, network, settings(), half=True)
    assert half.stat().st_size < 0.75 * saved.stat().st_size
    for name, weight in load_checkpoint(half)[0].state_dict().items():
        assert weight.dtype == torch.float32
        torch.testing.assert_close(weight, network.state_dict()[name], atol=1e-3, rtol=1e-3)


def test_no_file(tmp_path):
    with pytest.raises(BadInputError, match=r"gone\.safetensors: no such checkpoint"):
        load_checkpoint(tmp_path / "gone.safetensors")


@pytest.mark.parametrize("content", [b"", b"garbage", b"\x80\x04pickle", b"\xff" * 64, b"[]" * 50])
def test_garbage(tmp_path, content):
    path = tmp_path / "model.safetensors"
    path.write_bytes(content)
    said = r"model\.safetensors: not a readable safetensors file \(.*\); name a file that"
    with pytest.raises(BadInputError, match=said):
        load_checkpoint(path)


@pytest.mark.parametrize("keep", [0.3, 0.99])
def test_truncated(saved, keep):
    saved.write_bytes(saved.read_bytes()[: int(keep * saved.stat().st_size)])
    with pytest.raises(BadInputError, match="not a readable safetensors"):
        load_checkpoint(saved)


@pytest.mark.parametrize("place", [0.6, 0.8, 0.999])
def test_a_bit_that_changes_a_weight_a_little_is_seen(saved, place):
    data = bytearray(saved.read_bytes())
    at = int(place * len(data)) & ~3
    data[at] ^= 1  # the least of a float32's bits
    saved.write_bytes(data)
    with pytest.raises(BadInputError, match=r"model\.safetensors: the checksum is wrong"):
        load_checkpoint(saved)


def test_a_changed_setting_is_seen_and_files_without_a_checksum_are_read(saved):
    with safe_open(saved, framework="pt") as file:
        text = file.metadata()["settings"]
    rewritten(saved, metadata={"settings": text + " "})
    with pytest.raises(BadInputError, match="the checksum is wrong"):
        load_checkpoint(saved)
    rewritten(saved, metadata={"settings": text + " ", "sha256": None})
    load_checkpoint(saved)


def test_foreign_safetensors(tmp_path):
    path = tmp_path / "foreign.safetensors"
    save_file({"weight": torch.zeros(3)}, path)
    with pytest.raises(BadInputError) as refused:
        load_checkpoint(path)
    for part in (str(path), "expected a wildshape-checkpoint of version 1", "no format"):
        assert part in str(refused.value)


def test_another_version(saved):
    rewritten(saved, metadata={"version": "7"})
    with pytest.raises(BadInputError, match=r"of version 1, found .* version 7"):
        load_checkpoint(saved)


def test_missing_weight_is_named(saved):
    rewritten(saved, drop=["pose.weight2"])
    with pytest.raises(BadInputError, match=r"missing \['pose.weight2'\], unexpected none"):
        load_checkpoint(saved)


def test_unexpected_and_misshapen_weights_are_named(saved):
    rewritten(saved, add={"extra": torch.zeros(1), "shape.layer1.bias": torch.zeros(5)})
    with pytest.raises(BadInputError) as refused:
        load_checkpoint(saved)
    assert "unexpected ['extra']" in str(refused.value)
    assert "another shape ['shape.layer1.bias']; take another copy" in str(refused.value)


def _damage(change):
    def damaged(text):
        values = json.loads(text)
        change(values)
        return json.dumps(values)

    return damaged


@pytest.mark.parametrize(
    "damage",
    [
        lambda _: "not json",
        lambda _: "7",
        lambda _: "[]",
        _damage(lambda v: v.pop("network")),
        _damage(lambda v: v["projection"].update(kind="HexBins")),
        _damage(lambda v: v["network"].update(colour=3)),
        _damage(lambda v: v["network"].update(encoder=7)),
        _damage(lambda v: v["network"].update(points="many")),
        _damage(lambda v: v.update(extent_m=None)),
    ],
)
def test_damaged_settings(saved, damage):
    with safe_open(saved, framework="pt") as file:
        text = file.metadata()["settings"]
    rewritten(saved, metadata={"settings": damage(text)})
    with pytest.raises(BadInputError, match="settings are damaged"):
        load_checkpoint(saved)


def test_an_interrupted_write_leaves_the_old_file(saved, network, monkeypatch):
    before = saved.read_bytes()

    def disk_full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("wildshape.method.checkpoint.packed_network", disk_full)
    with pytest.raises(OSError, match="No space"):
        save_checkpoint(saved, network, settings())
    assert saved.read_bytes() == before
    assert [p.name for p in saved.parent.iterdir()] == [saved.name]
