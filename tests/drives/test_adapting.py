# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a model learns of the vehicles that it found, and when that is used."""

import json
import os
import shutil
from contextlib import suppress
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from tests.drives.finished_drive import CARS, finished_drive
from tests.models import CONFIG, SETTINGS
from tests.refusal import refused
from tests.stopping import Killed

from wildshape.drives.adapting import adapt, second_pass
from wildshape.drives.adapting.adapt import adapt_to
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.examples import Example, examples_of, split
from wildshape.drives.adapting.fine_tuning import recipe_of
from wildshape.drives.adapting.measures import Measures, clear_headed
from wildshape.drives.result import DriveResult
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import Predictor, load
from wildshape.inference.tracks.heading_vote import turned_where
from wildshape.method.checkpoint import MODEL, load_checkpoint
from wildshape.method.network import ShapePoseNet
from wildshape.records import Box, Completion
from wildshape.training import loop
from wildshape.training.setup import split_tracks

FEW = AdaptConfig(
    steps=3, fewest_held=1, fewest_trained=1, scans=3, fewest_scans=2, clear=0.0, save_every=2
)
GOOD = Measures(0.1, (0.1, 0.1, 0.1), 0.9)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return finished_drive(tmp_path_factory.mktemp("drive")).out


@pytest.fixture(scope="module")
def predictor():
    torch.manual_seed(1)
    return Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS)


def measured(monkeypatch, after):
    """The first model is measured as `GOOD`, the adapted one as `after`."""
    found = iter((GOOD, after))
    monkeypatch.setattr(adapt, "measure", lambda *_: next(found))


def test_an_example_looks_where_its_boxes_look(out):
    found = {one.name: one for one in examples_of([out], FEW)}
    assert set(found) == {f"found-{name}" for name in CARS}
    assert {name: one.moving for name, one in found.items()} == {
        "found-0003": False,
        "found-<7>": True,
    }
    for name, places in CARS.items():
        _, _, yaw = places[0]
        fronts = found[f"found-{name}"].fronts
        assert fronts == pytest.approx(np.tile((np.cos(yaw), np.sin(yaw), 0.0), (3, 1)), abs=1e-6)


def test_a_scan_whose_box_was_taken_away_is_refused(tmp_path):
    out = finished_drive(tmp_path).out
    lines = (out / "boxes.csv").read_text().splitlines(keepends=True)
    (out / "boxes.csv").write_text(
        "".join(one for one in lines if not one.startswith("2,0.2,0003"))
    )
    refused(examples_of, [out], FEW, match="boxes.csv: no box of track '0003' in scan 000002")


def test_headings_are_the_share_that_looks_as_the_boxes_do(out):
    one = examples_of([out], FEW)[0]
    fronts = torch.from_numpy(one.fronts)
    across = torch.stack((-fronts[:, 1], fronts[:, 0], fronts[:, 2]), -1)
    up = torch.tensor((0.0, 0.0, 1.0)).double().expand(len(fronts), 3)
    T_sensor_object = SE3(torch.stack((fronts, across, up), -1), torch.zeros_like(fronts))
    turned = turned_where(T_sensor_object, torch.tensor((1.0, -1.0, 1.0)), 0.0)
    box = Box((0.0, 0.0, 0.0), (4.0, 2.0, 1.5), (1.0, 0.0, 0.0, 0.0))
    nothing = np.empty((0, 3), np.float32)
    done = [Completion(nothing, turned[i], box, 0.5, branch=0, cost=0.1) for i in range(3)]
    assert one.share_alike(done) == pytest.approx(2 / 3)


def test_a_share_of_whole_tracks_is_held_out():
    examples = [Example(f"{i}", (), np.empty((0, 3)), False) for i in range(12)]
    trained, held = split(examples, AdaptConfig(held_out=0.25))
    assert (len(trained), len(held)) == (9, 3)
    assert {one.name for one in trained + held} == {one.name for one in examples}


def test_only_what_drives_or_looks_clearly_one_way_is_learnt_from(out, predictor, monkeypatch):
    examples = examples_of([out], FEW)

    def kept(share):
        monkeypatch.setattr(Example, "share_alike", lambda *_: share)
        found = clear_headed(predictor, examples, replace(FEW, clear=0.75), lambda _: None)
        return {one.name for one in found}

    assert kept(0.75) == {one.name for one in examples}
    assert kept(0.5) == {one.name for one in examples if one.moving}


def test_examples_after_a_second_pass_are_of_the_first(tmp_path):
    out = finished_drive(tmp_path).out
    (out / "first").mkdir()
    for name in ("boxes.csv", "tracks"):
        shutil.move(out / name, out / "first" / name)
    leave_results(out, "adapted")
    found = {one.name for one in examples_of([out], FEW)}
    assert found == {f"found-{name}" for name in CARS}


@pytest.mark.parametrize(
    ("after", "said"),
    [
        (replace(GOOD, cost_m=0.11), "its shapes cost more"),
        (replace(GOOD, spread_m=(0.0, 0.0, 0.31)), "its sizes agree less along tracks"),
        (replace(GOOD, headings=0.8), "it turns more scans around"),
    ],
)
def test_one_worse_measure_is_enough(after, said):
    assert after.worse_than(GOOD) == (said,)
    assert GOOD.worse_than(GOOD) == ()


def test_all_tracks_that_are_not_held_out_are_fitted():
    fitted, _ = split_tracks(200, recipe_of(SETTINGS, AdaptConfig()).held_out)
    assert sorted(fitted) == list(range(200))


def test_a_worse_model_is_refused(out, predictor, tmp_path, monkeypatch):
    measured(monkeypatch, replace(GOOD, cost_m=0.11))
    found = adapt_to([out], tmp_path, predictor, FEW)
    assert found.model is None
    assert "not kept, for its shapes cost more; what was found stays" in found.sentence
    assert not (tmp_path / "adapted" / "model.safetensors").exists()


def test_a_better_model_is_kept_and_says_what_the_first_one_knew(
    out, predictor, tmp_path, monkeypatch
):
    measured(monkeypatch, replace(GOOD, cost_m=0.09))
    found = adapt_to([out], tmp_path, predictor, FEW)
    said = json.loads((tmp_path / "adapted.json").read_text("utf-8"))
    assert (said["kept"], said["steps"], said["trained"], said["held_out"]) == (True, 3, 1, 1)
    assert (said["before"]["cost_m"], said["after"]["cost_m"]) == (0.1, 0.09)
    adapted = load(tmp_path / "adapted")
    assert str(tmp_path / "adapted") in str(found.model)
    assert adapted.settings.cost_m == SETTINGS.cost_m
    weights = (one.network.state_dict() for one in (predictor, adapted))
    assert any(not torch.equal(was, now) for was, now in zip(*map(dict.values, weights)))
    assert adapt_to([out], tmp_path, predictor, FEW) == found
    moved = tmp_path.rename(tmp_path.with_name("moved"))
    assert adapt_to([out], moved, predictor, FEW).model == str(moved / "adapted" / MODEL)


def test_weights_that_were_removed_are_put_there_again(out, predictor, tmp_path, monkeypatch):
    """They were said to be there: the drive's second pass then asked for another checkpoint."""
    measured(monkeypatch, replace(GOOD, cost_m=0.09))
    found = adapt_to([out], tmp_path, predictor, FEW)
    weights = load_file(tmp_path / "adapted" / MODEL)
    (tmp_path / "adapted" / MODEL).unlink()
    assert adapt_to([out], tmp_path, predictor, FEW).model == found.model
    again = load_file(tmp_path / "adapted" / MODEL)
    assert all(torch.equal(again[name], weights[name]) for name in weights)


def test_half_a_model_is_never_the_adapted_one(out, predictor, tmp_path, monkeypatch):
    measured(monkeypatch, replace(GOOD, cost_m=0.09))

    def killed(source, target, *_):
        target.write(source.read(1000))
        raise Killed

    with monkeypatch.context() as patched, suppress(Killed):
        patched.setattr(shutil, "copyfileobj", killed)
        adapt_to([out], tmp_path, predictor, FEW)
    assert (tmp_path / "adapted" / "run" / "candidate.safetensors").is_file()
    assert not (tmp_path / "adapted" / MODEL).exists()


def test_an_adaptation_of_other_drives_weights_or_steps_is_not_gone_on_with(
    out, predictor, tmp_path, monkeypatch
):
    """The first pass may have been made anew, the weights trained anew under the same words."""
    measured(monkeypatch, replace(GOOD, cost_m=0.09))
    adapt_to([out], tmp_path, predictor, FEW)
    for way in (
        ([out], tmp_path, Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS), FEW),
        ([out], tmp_path, predictor, replace(FEW, steps=4)),
    ):
        refused(adapt_to, *way, match="remove this folder to adapt anew")
    record = out / "wildshape.json"
    before = record.read_text()
    record.write_text(before.replace('"settings": {', '"settings": {"recording": "another",'))
    assert record.read_text() != before
    try:
        refused(adapt_to, [out], tmp_path, predictor, FEW, match="remove this folder to adapt anew")
    finally:
        record.write_text(before)


def test_a_killed_adaptation_goes_on_to_the_same_weights(out, predictor, tmp_path, monkeypatch):
    """Killed behind the checkpoint of step 2 of 3, and before the adapted model is measured."""
    save = loop.checkpoint

    def killed(run):
        save(run)
        raise Killed

    told = []

    def watch(*said):
        told.append(said)
        if said[0] == "measuring after" and "measuring after" not in again:
            again.append(said[0])
            raise Killed

    again = []
    with monkeypatch.context() as patched:
        patched.setattr(loop, "checkpoint", killed)
        with pytest.raises(Killed):
            adapt_to([out], tmp_path / "killed", predictor, FEW, watch=watch)
    assert ("training", 0, 3) in told
    assert ("measuring before", 1, 1) in told
    told.clear()
    with pytest.raises(Killed):
        adapt_to([out], tmp_path / "killed", predictor, FEW, watch=watch)
    assert told == [("training", 2, 3), ("training", 3, 3), ("measuring after", 1, 1)]
    told.clear()
    adapt_to([out], tmp_path / "killed", predictor, FEW, watch=watch)
    assert told == [("training", 3, 3), ("measuring after", 1, 1)]
    adapt_to([out], tmp_path / "whole", predictor, FEW)
    killed_, whole = (
        load_checkpoint(tmp_path / name / "adapted" / "run" / "candidate.safetensors")[0]
        for name in ("killed", "whole")
    )
    for one, other in zip(killed_.parameters(), whole.parameters(), strict=True):
        assert torch.equal(one, other)


def leave_results(folder, said):
    """What a pass leaves: a line of boxes, and a vehicle named after it."""
    for part in ("tracks", "objects", "shapes"):
        (folder / part / said).mkdir(parents=True)
        (folder / part / said / "file").write_text(said)
    (folder / "boxes.csv").write_text(said)


def results(folder):
    """What is said in a folder of such results."""
    said = [(folder / "boxes.csv").read_text()]
    for part in ("tracks", "objects", "shapes"):
        said += [one.name for one in (folder / part).iterdir()]
    return said


def second(out, model):
    """A second pass that finds what the model is called."""
    second_pass.put_in_place(out)
    if second_pass.is_done(out, str(model)):
        return
    second_pass.begin_second(out, str(model))
    found, stage = second_pass.results_of(out), second_pass.stages_of(out) / "objects"
    for left in stage.glob("*"):
        assert left.name == model.name
    (stage / model.name).mkdir(parents=True, exist_ok=True)
    if not found.is_dir():
        leave_results(found, model.name)
    second_pass.conclude(out, DriveResult(out, 1, 1, (model.name,), 1, 0, (), {}), str(model))


def dying(monkeypatch, steps):
    """From the so-many-th change of the disk on every one fails."""
    left = iter(range(steps))
    for name in ("rename", "replace", "unlink", "rmdir"):
        change = getattr(os, name)

        def changed(*given, change=change, **named):
            if next(left, None) is None:
                raise Killed
            return change(*given, **named)

        monkeypatch.setattr(os, name, changed)


def test_a_second_adapted_model_killed_at_any_instant_keeps_the_true_first_pass(
    tmp_path, monkeypatch
):
    start, models = tmp_path / "start", [tmp_path / name for name in ("one", "other")]
    leave_results(start, "first")
    (start / "wildshape.json").write_text("{}")
    for model in models:
        model.write_text(model.name)
    for model in models:
        out = start
        for steps in count():
            out = shutil.copytree(start, tmp_path / f"{model.name}-{steps}")
            alive = False
            with monkeypatch.context() as patched, suppress(Killed):
                dying(patched, steps)
                second(out, model)
                alive = True
            second(out, model)
            assert results(out) == [model.name] * 4
            assert results(out / "first") == ["first"] * 4
            if alive:
                break
        start = out
