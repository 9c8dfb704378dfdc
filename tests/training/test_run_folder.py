# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run is gone on with only by the same training on the same tracks."""

import shutil
from dataclasses import replace

import pytest

from wildshape.baselines.dpc.train import train_dpc
from wildshape.errors import BadInputError
from wildshape.io.inputs import open_tracks
from wildshape.io.output import MARKER, begin
from wildshape.io.scans.points import Coordinates
from wildshape.io.scans.writers import write_ply
from wildshape.io.write_tracks import write_tracks
from wildshape.method.checkpoint import load_checkpoint, weights_file
from wildshape.training.options import TrainingOptions
from wildshape.training.recipes import PRESETS, tiny
from wildshape.training.run_folder import begun_run, open_training_data
from wildshape.training.state import STATE
from wildshape.training.train import train

OPTIONS = TrainingOptions(preset="tiny", steps=2)
AGAIN = replace(OPTIONS, resume=True)


@pytest.fixture
def folders(cars, tmp_path):
    """Two folders of the same track."""
    paths = tmp_path / "one", tmp_path / "two"
    for path in paths:
        write_tracks(cars[:1], path, "folders", command="x", settings={})
    return paths


def test_a_run_goes_on_with_its_own_tracks_alone(folders, tmp_path):
    one, two = folders
    out = tmp_path / "run"
    packed = open_training_data(one, out, OPTIONS)
    for same in (one, tmp_path / "run" / ".." / "one", packed.path):
        assert open_training_data(same, out, AGAIN).fingerprint == packed.fingerprint
    with pytest.raises(BadInputError, match="two: the run packed tracks of another place"):
        open_training_data(two, out, AGAIN)
    for other in (Coordinates(unit="cm"), Coordinates(origin=(0.0, 1.0, 0.0))):
        with pytest.raises(BadInputError, match="--unit or --origin"):
            open_training_data(one, out, replace(AGAIN, coordinates=other))
        with pytest.raises(BadInputError, match=r"in metres .* already"):
            open_training_data(packed.path, out, replace(OPTIONS, coordinates=other))


@pytest.mark.parametrize("change", ["added", "removed", "replaced", "gone"])
def test_a_run_is_not_gone_on_with_once_its_tracks_have_changed(folders, tmp_path, cars, change):
    one, _ = folders
    out = tmp_path / "run"
    packed = open_training_data(one, out, OPTIONS)
    track = one / cars[0].name
    scan = sorted((track / "scans").iterdir())[0]
    scan.touch()  # as a copy would
    open_training_data(one, out, AGAIN)
    if change == "added":
        shutil.copytree(track, one / "new")
    elif change == "replaced":
        write_ply(scan, cars[0].scans[0][1:])
    elif change == "removed":
        scan.unlink()
    else:
        shutil.rmtree(one)
    with pytest.raises(BadInputError, match=r"one: holds other files .* with .*data\.store"):
        open_training_data(one, out, AGAIN)
    assert open_training_data(packed.path, out, AGAIN).fingerprint == packed.fingerprint


def test_a_run_that_kept_no_fingerprint_goes_on(folders, tmp_path):
    one, _ = folders
    origin = {"input": str(one.resolve()), "unit": "m", "origin": [0.0, 0.0, 0.0]}
    store = tmp_path / "run" / "data.store"
    write_tracks(open_tracks(one), store, "packed", command="train", settings=origin)
    assert open_training_data(one, tmp_path / "run", AGAIN).path == store


@pytest.mark.parametrize(
    ("name", "value"), [("preset", "small"), ("encoder", "dgcnn"), ("steps", 3), ("seed", 1)]
)
def test_before_its_first_state_a_run_goes_on_with_its_own_settings_alone(
    folders, tmp_path, name, value
):
    out = tmp_path / "run"
    for options in (OPTIONS, AGAIN):
        with begun_run(folders[0], out, options):
            pass
    other = replace(AGAIN, **{name: value})
    with (
        pytest.raises(BadInputError, match=f"other {name}; resume"),
        begun_run(folders[0], out, other),
    ):
        pass
    (out / STATE).touch()  # whose identity decides from here on
    with begun_run(folders[0], out, other):
        pass


def test_the_presets_own_number_of_steps_may_be_said_or_not(folders, tmp_path, monkeypatch):
    two = replace(tiny(), optim=replace(tiny().optim, steps=2))
    monkeypatch.setitem(PRESETS, "tiny", lambda: two)
    unsaid = replace(OPTIONS, steps=None)
    train(folders[0], tmp_path / "run", unsaid)
    again = train(folders[0], tmp_path / "run", AGAIN)
    assert "finished already" in again.sentence
    with pytest.raises(BadInputError, match="other settings; resume"):
        train(folders[0], tmp_path / "run", replace(AGAIN, steps=3))


@pytest.mark.parametrize("options", [OPTIONS, AGAIN], ids=["anew", "resumed"])
@pytest.mark.parametrize("finished", [False, True])
def test_what_another_command_wrote_is_left_alone(folders, tmp_path, options, finished):
    out = tmp_path / "completed"
    output = begin(out, "complete", {}, ["*.ply"])
    if finished:
        output.finish()
    before = (out / MARKER).read_bytes()
    with (
        pytest.raises(BadInputError, match=r"output of .*`complete`"),
        begun_run(folders[0], out, options),
    ):
        pass
    assert (out / MARKER).read_bytes() == before


def test_a_damaged_marker_is_refused(folders, tmp_path):
    out = tmp_path / "run"
    out.mkdir()
    (out / MARKER).write_text('{"command": "train"}')
    with pytest.raises(BadInputError, match=MARKER), begun_run(folders[0], out, AGAIN):
        pass


@pytest.mark.parametrize("taught", [{}, {"teacher": "shipped"}])
def test_the_shipped_weights_are_fine_tuned_with_all_that_they_see(folders, tmp_path, taught):
    options = TrainingOptions(preset="default", start="shipped", steps=1, **taught)
    run = train(folders[0], tmp_path / "run", options)
    before, shipped = load_checkpoint(weights_file(None))
    after, settings = load_checkpoint(run.model)
    assert settings.network == shipped.network
    assert settings.network.rays is not None
    for name, weights in before.state_dict().items():  # one step of the warm-up
        assert (after.state_dict()[name] - weights).abs().max() < 1e-3, name


def test_weights_are_not_removed_by_the_run_that_reads_them(folders, tmp_path):
    run = tmp_path / "run"
    train(folders[0], run, OPTIONS)
    before = sorted(path.name for path in run.iterdir())
    for named in ({"start": str(run)}, {"teacher": str(run / "model.safetensors")}):
        with pytest.raises(BadInputError, match="holds the input"):
            train(folders[0], run, replace(OPTIONS, overwrite=True, **named))
    assert sorted(path.name for path in run.iterdir()) == before
    with pytest.raises(BadInputError, match="pass one of them"):
        replace(OPTIONS, resume=True, overwrite=True)


@pytest.mark.parametrize(
    "wrong",
    [
        {"data": "nowhere"},
        {"coordinates": Coordinates("mm")},
        {"start": "shipped"},
        {"teacher": "two/scan.npy"},
        {"preset": "dpc-lidar-small", "data": "nowhere"},
        {"preset": "dpc-small"},
        {"preset": "paper-views"},
    ],
    ids=str,
)
def test_a_finished_run_stays_where_the_one_to_replace_it_is_refused(folders, tmp_path, wrong):
    run = tmp_path / "run"
    train(folders[0], run, OPTIONS)
    before = sorted(path.name for path in run.iterdir())
    named = {name: value for name, value in wrong.items() if name != "data"}
    if "teacher" in named:
        named["teacher"] = str(tmp_path / named["teacher"])
        (tmp_path / "two" / "scan.npy").write_bytes(b"")
    options = replace(OPTIONS, overwrite=True, **named)
    begin = train_dpc if options.preset.startswith("dpc") else train
    with pytest.raises(BadInputError):
        begin(tmp_path / wrong.get("data", "one"), run, options)
    assert sorted(path.name for path in run.iterdir()) == before


@pytest.mark.parametrize("preset", ["tiny", "dpc-lidar-small"])
def test_a_finished_run_stays_where_several_processes_cannot_replace_it(
    folders, tmp_path, preset, monkeypatch
):
    run = tmp_path / "run"
    train(folders[0], run, OPTIONS)
    before = sorted(path.name for path in run.iterdir())
    monkeypatch.setenv("WORLD_SIZE", "2")
    options = replace(OPTIONS, preset=preset, overwrite=True)
    begin = train_dpc if preset.startswith("dpc") else train
    with pytest.raises(BadInputError, match="process"):
        begin(folders[0], run, options)
    assert sorted(path.name for path in run.iterdir()) == before
