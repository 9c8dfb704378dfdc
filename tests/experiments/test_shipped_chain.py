# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The command that makes the shipped weights: a few tracks and steps of its rounds."""

from dataclasses import replace
from functools import partial

import pytest
import torch
from experiments.shipped_chain import Settings, driving, trained
from experiments.shipped_rounds import DATA, ROUNDS

from experiments import shipped_chain, shipped_rounds
from wildshape.errors import BadInputError
from wildshape.method.checkpoint import load_checkpoint
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.config import ValidationConfig
from wildshape.training.recipes import PRESETS

LAST = tuple(ROUNDS)[-1]


def quick(name):
    """A preset that is hardly validated."""
    return replace(PRESETS[name](), validation=ValidationConfig(1, 1, 2, 4))


def test_the_last_round_goes_on_from_weights_that_teach_it(
    cad, tmp_path, monkeypatch, half_written
):
    """What a stop left of the first rounds' tracks is no hindrance."""
    monkeypatch.setattr(shipped_chain, "_SENSORS", ("hdl64",))
    monkeypatch.setattr(shipped_chain, "_SCANS", 5)
    drives = {seed: replace(tracks, varied=(True,)) for seed, tracks in DATA.items()}
    monkeypatch.setattr(shipped_chain, "DATA", drives)
    presets = {name: partial(quick, name) for name in PRESETS}
    monkeypatch.setattr(shipped_rounds, "PRESETS", presets)
    few = Settings(tmp_path, cad, share=1e-4)
    half_written(tmp_path / "tracks1")
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
    assert of_other.provenance["command"].endswith(f"--share 0.0001 --start {taught.name}")
    full = replace(few, share=1.0, only=("default",))
    for other in (full, replace(full, start=few.finished("first"))):
        with pytest.raises(BadInputError, match=f"{last.name}: was made by .* of other weights"):
            shipped_chain.main(other)


def test_where_a_vehicle_goes_is_where_it_looks():
    """As the sensor sees it, whichever side it passes on: by its own motion and the scans alone."""
    tracks = list(simulate_tracks(SimulationConfig(tracks=8, scans=12), seed=77))
    poses = [track.T_sensor_object for track in tracks]
    looks = torch.cat([pose.rotation[:, :, 0] for pose in poses if pose is not None]).float()
    ways = driving(tracks)
    assert (looks[:, 0] < -0.5).any()  # oncoming
    assert (looks[:, 0] > 0.5).any()
    assert ((ways * looks).sum(-1) > 0.8).all()


def test_a_trial_leaves_nothing_that_a_full_run_takes_for_its_own(cad, tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(shipped_chain, "trained", lambda name, of: kept.append(of.finished(name)))
    monkeypatch.setattr(shipped_chain, "_shipped", lambda *of: None)
    for share in (0.01, 1.0):
        shipped_chain.main(Settings(tmp_path, cad, share, only=("default",)))
    assert len(set(kept)) == 2 * len(ROUNDS)
    assert kept[-1] == tmp_path / f"{LAST}.safetensors"


def test_a_finished_round_and_those_before_it_are_not_trained_again(cad, tmp_path, monkeypatch):
    asked, settings = [], Settings(tmp_path, cad, only=("default",))
    settings.finished("second").write_bytes(b"of another machine")
    monkeypatch.setattr(shipped_chain, "trained", lambda name, of: asked.append(name))
    monkeypatch.setattr(shipped_chain, "_shipped", lambda *of: None)
    shipped_chain.main(settings)
    assert asked == list(ROUNDS)[3:]
