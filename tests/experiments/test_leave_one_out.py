# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A model adapted to all objects but one, on a few scans."""

import torch
from experiments.leave_one_out import Settings, main
from tests.models import CONFIG, SETTINGS

from wildshape.io.write_tracks import write_tracks
from wildshape.method.checkpoint import fingerprint, save_checkpoint
from wildshape.method.network import ShapePoseNet


def test_each_object_is_left_out_in_turn(cars, tmp_path, capsys):
    torch.manual_seed(0)
    model = tmp_path / "model.safetensors"
    save_checkpoint(model, ShapePoseNet(CONFIG).eval(), SETTINGS)
    few = (car.part(range(3)) for car in cars[:3])
    write_tracks(few, tmp_path / "data", "packed", command="test", settings={})
    main(Settings(tmp_path / "data", tmp_path / "run", str(model), steps=2, most=2))
    said = capsys.readouterr().out
    assert "2 objects left out in turn" in said
    rows = [line for line in said.splitlines() if line.startswith(("| before", "| after"))]
    assert len(rows) == 4
    run = tmp_path / "run" / fingerprint(model)
    for car in cars[:2]:
        assert f"{car.name}: BEV IoU" in said
        assert (run / car.name / "run" / "candidate.safetensors").is_file()
    assert not (run / cars[2].name).exists()
