# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`train --teacher`: a checkpoint, the run's folder, or the truth; and what it refuses."""

import json

import torch
from safetensors.torch import load_file

from wildshape.training import setup


def test_a_run_teaches_the_next_one_and_a_repeated_resume_leaves_it_alone(
    wildshape, store, trained, tmp_path
):
    out = tmp_path / "taught"
    order = ("train", store, "--out", out, "--preset", "tiny", "--steps", 6, "--device", "cpu")
    done = wildshape(*order, "--teacher", trained, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["steps"] == 6
    assert (out / "targets.safetensors").is_file()
    weights = (out / "model.safetensors").read_bytes()
    again = wildshape(*order, "--teacher", trained, "--resume")
    assert again.code == 0, again.err
    assert "finished already" in again.out
    assert (out / "model.safetensors").read_bytes() == weights
    assert set(load_file(out / "model.safetensors")) == set(
        load_file(trained / "model.safetensors")
    )


def test_a_teacher_that_is_not_there(refused, store, tmp_path):
    order = ("train", store, "--out", tmp_path / "out", "--preset", "tiny", "--steps", 6)
    assert "nobody.safetensors" in refused(*order, "--teacher", tmp_path / "nobody.safetensors")


def test_a_run_without_a_model_is_no_teacher_and_nothing_stays(refused, store, tmp_path):
    (tmp_path / "stopped").mkdir()
    order = ("train", store, "--out", tmp_path / "out", "--preset", "tiny", "--steps", 6)
    for option in ("--teacher", "--start"):
        assert f"{option} {tmp_path}" in refused(*order, option, tmp_path / "stopped")
    assert not (tmp_path / "out").exists()


def test_a_stop_while_tracks_are_fused_says_how_to_go_on(
    wildshape, store, trained, tmp_path, monkeypatch
):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(setup, "fused_targets", stopped)
    order = ("train", store, "--out", tmp_path / "out", "--preset", "tiny", "--steps", 6)
    done = wildshape(*order, "--teacher", trained)
    assert done.code == 130
    assert "--resume`" in done.err
    monkeypatch.undo()
    assert wildshape(*order, "--teacher", trained, "--resume").code == 0


def test_a_finished_run_writes_a_lost_model_again(wildshape, store, tmp_path):
    out = tmp_path / "out"
    order = ("train", store, "--out", out, "--preset", "tiny", "--steps", 6, "--device", "cpu")
    assert wildshape(*order).code == 0
    before = load_file(out / "model.safetensors")
    (out / "model.safetensors").unlink()
    assert wildshape(*order, "--resume").code == 0
    again = load_file(out / "model.safetensors")
    assert all(torch.equal(before[name], again[name]) for name in before)


def test_headings_are_asked_of_lidar_weights_for_a_teacher_alone(
    refused, wildshape, store, trained, tmp_path
):
    order = ("train", store, "--out", tmp_path / "run", "--preset", "tiny", "--steps", 2)
    assert "--teacher" in refused(*order, "--headings", "shipped")
    assert "LiDAR" in refused(*order, "--teacher", trained, "--headings", "airplane", "--overwrite")
    done = wildshape(*order, "--teacher", trained, "--headings", trained, "--overwrite")
    assert done.code == 0, done.err
