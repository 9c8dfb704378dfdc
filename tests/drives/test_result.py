# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What decides a drive's result."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from tests.models import CONFIG, SETTINGS

from wildshape.drives.adapting.second_pass import like
from wildshape.drives.config import DriveConfig, TrajectoryConfig
from wildshape.drives.result import identity_of, line_of, settings_of
from wildshape.drives.source import Drive
from wildshape.drives.tracking.detections import DetectionFile
from wildshape.inference.predictor import Predictor, load
from wildshape.method.checkpoint import save_checkpoint
from wildshape.method.network import ShapePoseNet
from wildshape.records import Turn


def test_how_a_predictor_is_used_decides_the_result(tmp_path):
    torch.manual_seed(0)
    network = ShapePoseNet(CONFIG).eval()
    settings = replace(SETTINGS, facing=True, up=(0.0, 0.0, 1.0))
    drive = Drive.of("drive", ["000000"], lambda _: Turn(np.empty((0, 3), np.float32)))
    usual = Predictor(network, settings)
    others = [Predictor(network, settings, level=False), Predictor(network, settings, raw=True)]

    def said(predictor):
        return settings_of(tmp_path, drive, None, DriveConfig(), predictor, None)

    assert identity_of(usual).keys() == {"model", "weights", "inference"}
    assert said(usual) != said(others[0]) != said(others[1]) != said(usual)
    torch.manual_seed(1)
    assert said(Predictor(ShapePoseNet(CONFIG).eval(), settings)) != said(usual)
    assert said(Predictor(network, replace(settings, cost_m=(0.2, 0.3)))) != said(usual)
    model = tmp_path / "model.safetensors"
    save_checkpoint(model, network, settings)
    for one in (usual, *others):
        assert identity_of(like(one, model)) == identity_of(one)


def test_the_command_that_is_kept_finds_the_same(tmp_path):
    given = DetectionFile(Path("boxes.txt"), Path("calib.txt"), 0.3)
    line = line_of(Path("a b"), Path("out"), "/top", DriveConfig(rays=True), given, Path("mine"))
    assert line == (
        "wildshape drive 'a b' --out out --topic /top --model mine --detections boxes.txt"
        " --calibration calib.txt --min-score 0.3 --rays"
    )
    other = replace(DriveConfig(), trajectory=TrajectoryConfig(voxel_m=1.0))
    assert "from Python" in line_of(Path("a"), Path("out"), None, other, None)
    save_checkpoint(tmp_path / "model.safetensors", ShapePoseNet(CONFIG).eval(), SETTINGS)
    assert load(tmp_path).named == tmp_path
    assert load().named is None
