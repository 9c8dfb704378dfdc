# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever is changed in a checkpoint: it is refused in one sentence, or it completes scans."""

import copy
import json
import math
from itertools import product

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from wildshape.baselines.dpc import checkpoint as dpc_checkpoint
from wildshape.baselines.dpc.checkpoint import DpcSettings, load_dpc, save_dpc
from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.baselines.dpc.viewing_volume import PolarVolume
from wildshape.errors import BadInputError
from wildshape.inference.predictor import load
from wildshape.method import checkpoint
from wildshape.method.checkpoint import SHIPPED, load_checkpoint, save_checkpoint
from wildshape.method.network import NetworkConfig, ShapePoseNet

WRONG = (None, True, 0, -1, 0.5, 2_000_000, 10**30, 1e308, math.nan, math.inf, -math.inf)
WRONG = (*WRONG, "", "x", "1", [], [1], [math.nan] * 3, {}, {"kind": "PolarBins"})
FREE = ("provenance", "metrics")  # say where weights come from; nothing is computed with them


def paths_of(values, at=()):
    """Where each value lies, records and lists as well as what they hold."""
    entries = values.items() if isinstance(values, dict) else enumerate(values)
    for key, value in entries:
        if key in FREE:
            continue
        yield (*at, key)
        if isinstance(value, dict | list):
            yield from paths_of(value, (*at, key))


def changed(values, path, wrong):
    """Another value at a path; `paths_of`'s; nothing at all there for `...`."""
    values = copy.deepcopy(values)
    inner = values
    for key in path[:-1]:
        inner = inner[key]
    if wrong is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = wrong
    return values


def opened(path):
    with safe_open(path, framework="pt") as file:
        weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        return weights, file.metadata()


@pytest.fixture
def small(tmp_path):
    """Settings of the shipped weights, on a network of few."""
    torch.manual_seed(0)
    _, settings = load_checkpoint(SHIPPED)
    sizes = NetworkConfig((8, 8, 16, 16), (16, 16), (8, 8), 64, selector=True, mirror=True)
    network = ShapePoseNet(sizes)
    from dataclasses import replace

    path = tmp_path / "small.safetensors"
    save_checkpoint(path, network, replace(settings, network=sizes, input_points=64))
    return path


def scan():
    rng = np.random.default_rng(0)
    return (rng.uniform(-1, 1, size=(200, 3)) * (2.0, 0.9, 0.7) + (12.0, 3.0, -1.0)).astype("f4")


def test_every_setting_is_checked(small, monkeypatch):
    weights, metadata = opened(small)
    values, points = json.loads(metadata["settings"]), scan()
    built = []

    class Recorded(ShapePoseNet):
        def __init__(self, config):
            built.append(str(torch.get_default_device()))
            super().__init__(config)

    monkeypatch.setattr(checkpoint, "ShapePoseNet", Recorded)
    refused = 0
    for path, wrong in product(list(paths_of(values)), (*WRONG, ...)):
        text = json.dumps(changed(values, path, wrong))
        save_file(weights, small, {**metadata, "settings": text})
        built.clear()
        try:
            done = load(small).complete(points)
        except BadInputError as error:
            refused += 1
            assert str(error).startswith(str(small)), (path, wrong)  # noqa: PT017
            assert "\n" not in str(error)  # noqa: PT017
            assert set(built) <= {"meta"}, (path, wrong)
        else:
            assert np.isfinite(done.points).all(), (path, wrong)
            assert 0 <= done.confidence <= 1, (path, wrong)
    assert refused > 700


@pytest.mark.parametrize(
    ("path", "wrong", "said"),
    [
        (("network", "points"), 2_000_000, "network.points is 2000000, expected a whole number"),
        (("network", "points"), 2048, r"another shape \['shape.layer3.weight'"),
        (("network", "branches"), "4", "network.branches is '4', expected a whole number"),
        (("network", "scale"), math.nan, "network.scale is nan, expected a number from 0.001"),
        (("network", "scale"), 0, "network.scale is 0, expected"),
        (("network", "encoder"), [64, 128], "expected 4 values"),
        (("input_points",), 0, "input_points is 0, expected a whole number from 1 to 65536"),
        (("input_points",), 512.0, "input_points is 512.0, expected a whole number"),
        (("beta",), "0.25", "beta is '0.25', expected a number from 0 to 1000"),
        (("up",), [0, 0, 0], "expected a direction of length 1"),
        (("up",), [0, 1], "up is .*expected 3 values"),
        (("sensor",), "radar", "sensor is 'radar', expected lidar or camera"),
        (("projection", "kind"), "HexBins", "projection.kind is 'HexBins', expected PolarBins or"),
        (("facing",), 1, "facing is 1, expected bool"),
        (("cost_m",), [0.2, 0.1], "cost_m is 0.2, 0.1, expected a smaller and a larger"),
        (("calibration", "weights"), [0.0] * 9, "9 weights for 10 features"),
        (("trust", "scan", "pose", "weights"), [0.0], "4 features has 1 weights"),
        (("trust", "track", "kind", "features"), ["luck"] * 6, r"unknown features \['luck'\]"),
        (("colour",), 3, "the whole has an unknown colour"),
    ],
)
def test_what_is_wrong_is_said(tmp_path, path, wrong, said):
    weights, metadata = opened(SHIPPED)
    text = json.dumps(changed(json.loads(metadata["settings"]), path, wrong))
    save_file(weights, tmp_path / "m.safetensors", {**metadata, "settings": text})
    with pytest.raises(BadInputError, match=said):
        load_checkpoint(tmp_path / "m.safetensors")


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf, 3e38])
def test_weights_that_are_no_numbers(small, wrong):
    weights, metadata = opened(small)
    for name in weights:
        bad = {**weights, name: weights[name].clone()}
        bad[name].view(-1)[-1] = wrong
        save_file(bad, small, metadata)
        with pytest.raises(BadInputError, match=f"{name} holds values that are no numbers"):
            load_checkpoint(small)


def test_weights_of_another_kind(small):
    weights, metadata = opened(small)
    weights["pose.bias2"] = weights["pose.bias2"].to(torch.int32)
    save_file(weights, small, metadata)
    with pytest.raises(BadInputError, match=r"of another shape \['pose.bias2'\]"):
        load_checkpoint(small)


def test_the_same_holds_for_dpc(tmp_path, monkeypatch):
    sizes = DpcConfig(PolarVolume(), image=16, voxels=8, points=20, channels=4, code=16)
    path = tmp_path / "dpc.safetensors"
    save_dpc(path, DpcNet(sizes), DpcSettings(sizes))
    weights, metadata = opened(path)
    values = json.loads(metadata["settings"])
    built = []

    class Recorded(DpcNet):
        def __init__(self, config):
            built.append(str(torch.get_default_device()))
            super().__init__(config)

    monkeypatch.setattr(dpc_checkpoint, "DpcNet", Recorded)
    for place, wrong in product(list(paths_of(values)), (*WRONG, ...)):
        text = json.dumps(changed(values, place, wrong))
        save_file(weights, path, {**metadata, "settings": text})
        built.clear()
        try:
            load_dpc(path)
        except BadInputError as error:
            assert str(error).startswith(str(path)), (place, wrong)  # noqa: PT017
            assert set(built) <= {"meta"}, (place, wrong)
    save_file({**weights, "shape.bias": weights["shape.bias"] * math.nan}, path, metadata)
    with pytest.raises(BadInputError, match=r"shape\.bias holds values that are no numbers"):
        load_dpc(path)
