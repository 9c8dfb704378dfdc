# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of weights: checkpoints, training states and what else a run keeps to go on from."""

from pathlib import Path

import numpy as np
import torch
from tests.fuzz.scans import CLOUD
from tests.fuzz.target import Arrays, Target, only_file
from torch import nn

from wildshape.baselines.dpc.checkpoint import DpcSettings, is_dpc, load_dpc, save_dpc
from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.baselines.dpc.viewing_volume import PolarVolume
from wildshape.geometry.projection.visibility import PolarBins
from wildshape.inference.predictor import Predictor
from wildshape.method.checkpoint import ModelSettings, load_checkpoint, save_checkpoint
from wildshape.method.confidence import Calibration, ConfidenceFeatures
from wildshape.method.network import NetworkConfig, ShapePoseNet
from wildshape.training.batches.fused import FusedTargets
from wildshape.training.runtime.log import RunLog
from wildshape.training.self_training.targets import load_targets, save_targets
from wildshape.training.state import TrainState, load_state, save_state

_NETWORK = NetworkConfig((8, 8, 8, 16), (8, 8), (8, 8), points=32, branches=2, selector=True)
_DPC = DpcConfig(PolarVolume(), image=8, voxels=8, points=8, channels=2, code=8, candidates=2)
_SCANS, _TRACKS = 5, 2
_IDENTITY = {"settings": "a", "data": "b", "seed": "0"}


def _build_checkpoint(folder: Path) -> None:
    torch.manual_seed(0)
    calibration = Calibration((0.1,) * len(ConfidenceFeatures._fields), 0.0, 0.5, 0.3, "a test")
    common = ModelSettings(_NETWORK, "lidar", 32, PolarBins(), 0.5)
    whole = ModelSettings(
        **{**vars(common), "facing": True, "up": (0.0, 0.0, 1.0), "calibration": calibration}
    )
    for name, settings in (("plain", common), ("whole", whole)):
        path = folder / name / "model.safetensors"
        path.parent.mkdir(parents=True)
        save_checkpoint(path, ShapePoseNet(_NETWORK), settings, half=name == "plain")


def _read_checkpoint(folder: Path) -> Arrays:
    """Load it and complete a scan with it."""
    network, settings = load_checkpoint(only_file(folder))
    done = Predictor(network, settings, raw=True).complete(CLOUD.astype(np.float32))
    yield done.points
    yield np.array((*done.box.centre, *done.box.size, *done.box.quaternion_wxyz, done.confidence))


def _build_dpc(folder: Path) -> None:
    torch.manual_seed(0)
    (folder / "dpc").mkdir(parents=True)
    save_dpc(folder / "dpc" / "model.safetensors", DpcNet(_DPC), DpcSettings(_DPC))


def _read_dpc(folder: Path) -> Arrays:
    path = only_file(folder)
    is_dpc(path)
    network, _ = load_dpc(path)
    for weights in network.state_dict().values():
        yield weights.numpy()


def _state() -> TrainState[nn.Linear]:
    torch.manual_seed(0)
    network, mean = nn.Linear(3, 4), nn.Linear(3, 4)
    optimiser = torch.optim.Adam(network.parameters())
    network(torch.ones(2, 3)).sum().backward()
    optimiser.step()
    return TrainState(network, mean, optimiser, 7, torch.ones(_SCANS, 3, 3))


def _build_state(folder: Path) -> None:
    run = folder / "run"
    run.mkdir(parents=True)
    save_state(run, _state(), _IDENTITY)
    scans = (torch.ones(_SCANS, 3, 3), torch.ones(_SCANS, 3))
    tracks = (torch.ones(_TRACKS, 6, 3), torch.ones(_TRACKS, 4, 3), torch.ones(_TRACKS))
    save_targets(run, FusedTargets(*scans, *tracks), _IDENTITY)
    (run / "log.jsonl").write_text('{"step": 5, "loss": 1.0}\n{"step": 9, "loss": 0.5}\n')


def _read_state(folder: Path) -> Arrays:
    """As `train --resume`."""
    state = _state()
    targets = load_targets(folder, _IDENTITY, _SCANS, _TRACKS)
    load_state(folder, state, _IDENTITY, _SCANS)
    with RunLog(folder, state.step):
        pass
    for weights in (*state.network.state_dict().values(), *state.mean.state_dict().values()):
        yield weights.numpy()
    for tensor in (targets or ())[:4]:  # how high a view reaches may be unknown, and NaN
        yield tensor.numpy()
    state.optimiser.step()


TARGETS = (
    Target("checkpoint", _build_checkpoint, _read_checkpoint, 1.5),
    Target("dpc", _build_dpc, _read_dpc, 0.7),
    Target("training-state", _build_state, _read_state, 0.8, writes=True),
)
