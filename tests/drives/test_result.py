# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What decides a drive's result."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.drives.objects import still
from tests.models import CONFIG, SETTINGS
from tests.refusal import refused

from wildshape.drives.adapting.second_pass import like
from wildshape.drives.completing.level_frame import read_completed
from wildshape.drives.config import DriveConfig, TrajectoryConfig
from wildshape.drives.result import DriveResult, earlier_result, identity_of, line_of, settings_of
from wildshape.drives.source import Drive
from wildshape.drives.tracking.detections import DetectionFile
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.trajectory import Breaks
from wildshape.inference.folders.complete_folder import OBJECTS
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
    plain = line_of(Path("a"), Path("out"), None, DriveConfig(), None)
    assert plain == "wildshape drive a --out out"
    save_checkpoint(tmp_path / "model.safetensors", ShapePoseNet(CONFIG).eval(), SETTINGS)
    assert load(tmp_path).named == tmp_path
    assert load().named is None


@pytest.mark.parametrize(
    "wrong", [{"frames": None}, {"seconds": None}, {"seconds": {"tracks": "x"}}, {"warnings": "x"}]
)
def test_a_record_that_was_changed_is_refused(tmp_path, wrong):
    """A traceback where what was found is told, or letters for warnings."""
    found = DriveResult(tmp_path, 3, 2, ("0001",), 5, 0, ("odd",), {"tracks": 0.5})
    said = json.loads(json.dumps({**asdict(found), "out": "elsewhere"}))
    assert earlier_result(tmp_path, {"result": said}) == found
    refused(earlier_result, tmp_path, {"result": said | wrong}, match="wildshape.json: expected")


@pytest.mark.parametrize("text", ["{}", '{"frames": null}', "[]"])
def test_what_a_stage_left_is_refused_if_it_was_changed(tmp_path, text):
    """Tracebacks in a drive that was gone on with."""
    drive = Drive.of("drive", ["0"], lambda _: Turn(np.empty((0, 3), np.float32)))
    seen = Sightings("0001", (0,), ((0,),), (100,))
    for name in ("breaks.json", OBJECTS):
        (tmp_path / name).write_text(text)
    refused(read_completed, seen, tmp_path, drive, still(1), match=f"{OBJECTS}: expected")
    if text != "{}":  # of which all fields have defaults
        refused(Breaks.read, tmp_path / "breaks.json", match="breaks.json: expected")
