# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The command that makes the shipped weights: a few tracks and steps of its rounds."""

from dataclasses import replace
from functools import partial

import torch
from experiments.shipped_chain import DATA, ROUNDS, Settings, trained

from experiments import shipped_chain
from wildshape.method.checkpoint import load_checkpoint
from wildshape.training.config import ValidationConfig
from wildshape.training.recipes import PRESETS

LAST = tuple(ROUNDS)[-1]


def quick(name):
    """A preset that is hardly validated."""
    return replace(PRESETS[name](), validation=ValidationConfig(1, 1, 2, 4))


def test_the_last_round_goes_on_from_weights_that_teach_it(cad, tmp_path, monkeypatch):
    monkeypatch.setattr(shipped_chain, "_SENSORS", ("hdl64",))
    monkeypatch.setattr(shipped_chain, "_SCANS", 5)
    drives = {seed: replace(tracks, varied=(True,)) for seed, tracks in DATA.items()}
    monkeypatch.setattr(shipped_chain, "DATA", drives)
    monkeypatch.setattr(shipped_chain, "PRESETS", {name: partial(quick, name) for name in PRESETS})
    few = Settings(tmp_path, cad, share=1e-4)
    for name in ("first", "taught"):
        trained(name, few)
    taught = few.finished("taught")
    again = replace(few, start=taught)
    assert again.rounds == (LAST,)
    trained(LAST, again)
    last = again.finished(LAST)
    (one, of_one), (other, of_other) = (load_checkpoint(path) for path in (taught, last))
    assert one.rays is None
    assert other.rays is not None
    assert not torch.equal(next(one.parameters()), next(other.parameters()))
    assert [of.provenance["round"] for of in (of_one, of_other)] == ["taught", LAST]
    assert of_other.provenance["command"].endswith(f"--start {taught.name}")


def test_a_finished_round_of_another_machine_is_not_trained_again(cad, tmp_path, monkeypatch):
    weights = Settings(tmp_path, cad).finished("first")
    weights.write_bytes(b"kept")
    monkeypatch.setattr(shipped_chain, "setup", None)
    trained("first", Settings(tmp_path, cad))
    assert weights.read_bytes() == b"kept"
