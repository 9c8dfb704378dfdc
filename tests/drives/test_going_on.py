# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive that was killed, or is gone through a second time."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.refusal import refused
from tests.stopping import Killed

import wildshape
from wildshape.cli.main import main
from wildshape.drives import pipeline
from wildshape.drives.adapting import second_pass
from wildshape.drives.adapting.adapt import Adaptation
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.completing import selection
from wildshape.drives.completing.completion import Completer
from wildshape.drives.config import INFERENCE, ClusterConfig, DriveConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.tracking.sightings import read_sightings
from wildshape.drives.writing import outputs
from wildshape.drives.writing.finished import read_finished
from wildshape.inference.predictor import Predictor
from wildshape.io.boxes.table import read_box_table
from wildshape.io.tracks import read_track
from wildshape.method.checkpoint import SHIPPED, load_checkpoint, save_checkpoint

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")


def test_a_run_killed_at_any_stage_goes_on_to_the_same_boxes(
    found, recording, tmp_path, monkeypatch
):
    """The stages are stopped one after the other; each next run begins where the last stopped."""
    config = DriveConfig(rays=True)

    def killed(*_, **__):
        raise Killed

    for place, stage in (
        (pipeline, "find_trajectory"),
        (pipeline, "Cutter"),
        (pipeline, "linked_clusters"),
        (pipeline, "write_sightings"),
        (selection, "judge"),
        (outputs, "rays_bytes"),
        (outputs, "rows_of"),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(place, stage, killed)
            with pytest.raises(Killed):
                wildshape.drive(recording, tmp_path / "out", config)
    written = (tmp_path / "out" / "trajectory.txt").stat().st_mtime_ns
    spent = json.loads((tmp_path / "out" / "stages" / "seconds.json").read_text())
    again = wildshape.drive(recording, tmp_path / "out", config)
    assert (tmp_path / "out" / "trajectory.txt").stat().st_mtime_ns == written
    assert spent["trajectory"] <= again.seconds["trajectory"]
    for name in ("boxes.csv", "trajectory.txt", "frames.csv", "stages/tracks.json"):
        assert (tmp_path / "out" / name).read_bytes() == (found.out / name).read_bytes(), name
    for name in found.vehicles:
        track = read_track(again.out / "tracks" / name)
        for scan, rays in zip(track.scans, track.rays, strict=True):
            assert rays is not None
            assert len(rays) > 100
            apart = np.abs(rays.ends[:, None] - scan).max(2)
            assert apart.min() > 1e-4  # none ended in the vehicle's own points


def test_adapted_weights_complete_a_drive_again(found, recording, tmp_path, monkeypatch):
    """Killed before the second pass is finished the first one stays; killed later it is ended."""
    out = Path(shutil.copytree(found.out, tmp_path / "out"))
    network, settings = load_checkpoint(SHIPPED)
    model = tmp_path / "model.safetensors"
    save_checkpoint(model, network, replace(settings, provenance={"steps": 7}))
    adapted = Adaptation(str(model), 4, 2, 0)
    before = (out / "boxes.csv").read_bytes()
    (out / "report.html").touch()

    def killed(*_, **__):
        raise KeyboardInterrupt

    for place, name in ((outputs, "rows_of"), (second_pass, "write_json"), (second_pass, "_move")):
        assert (out / "boxes.csv").read_bytes() == before
        with monkeypatch.context() as patched:
            patched.setattr(place, name, killed)
            with pytest.raises(KeyboardInterrupt):
                wildshape.drive(recording, out, adapt=adapted)
    halves = [out / "boxes" / ".a.part", out / "stages" / "adapted" / ".b.part"]
    for half in halves:
        half.parent.mkdir(exist_ok=True)
        half.touch()
    again = wildshape.drive(recording, out)
    assert not any(half.exists() for half in halves)
    assert set(again.vehicles) == {folder.name for folder in (out / "objects").iterdir()}
    assert {row.track for row in read_box_table(out / "boxes.csv")} == set(again.vehicles)
    for name in again.vehicles:
        said = json.loads((out / "objects" / name / "objects.json").read_text("utf-8"))
        assert said["model"]["steps"] == 7
    assert (out / "first" / "boxes.csv").read_bytes() == before
    assert not (out / "report.html").exists()
    monkeypatch.setattr(Pipeline, "perform", killed)
    assert wildshape.drive(recording, out, adapt=adapted) == again


def test_too_few_vehicles_to_adapt_to_are_said(found, recording, tmp_path, capsys):
    out = shutil.copytree(found.out, tmp_path / "out")
    main(["drive", str(recording), "--out", str(out), "--adapt", "--no-report"])
    text = capsys.readouterr().out
    assert text.startswith("not adapted: ")
    assert "are too few; what was found stays" in text
    assert "found 4 vehicles" in text
    assert json.loads((out / "adapted.json").read_text("utf-8"))["kept"] is False
    assert wildshape.drive(recording, out, adapt=AdaptConfig()).vehicles == found.vehicles
    assert (out / "boxes.csv").read_bytes() == (found.out / "boxes.csv").read_bytes()


def test_other_settings_do_not_go_on_with_an_output(found, recording):
    other = DriveConfig(clusters=ClusterConfig(range_m=40.0))
    refused(wildshape.drive, recording, found.out, other, match="--overwrite")


@pytest.mark.parametrize("change", ["times.txt", "poses.txt", "a scan"])
def test_a_finished_drive_is_not_taken_for_that_of_a_changed_recording(
    found, recording, tmp_path, change
):
    """As somebody does who mends his recording and repeats the command."""
    out = shutil.copytree(found.out, tmp_path / "out")
    source = shutil.copytree(recording, tmp_path / "recording")
    moved_to(out, source)
    assert wildshape.drive(source, out).boxes == found.boxes
    files = sorted(source.glob("0*"))
    if change == "times.txt":
        (source / change).write_text("".join(f"{0.1 * row}\n" for row in range(len(files))))
    elif change == "poses.txt":
        (source / change).write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * len(files))
    else:
        files[-1].write_bytes(files[-1].read_bytes()[:-160])
    refused(
        wildshape.drive, source, out, match="with other settings or of other data; pass --overwrite"
    )


def moved_to(out, source):
    """A finished drive whose recording lies elsewhere now."""
    record = json.loads((out / "wildshape.json").read_text())
    record["settings"]["source"] = str(source)
    (out / "wildshape.json").write_text(json.dumps(record))


def test_what_is_missing_of_a_group_is_completed_as_it_was(found, recording, tmp_path, monkeypatch):
    """From the scans and the rays beside the object, whole tracks alone."""
    stages = found.out / "stages"
    completer = Completer(
        wildshape.load(config=INFERENCE),
        open_drive(recording),
        stages / "clusters",
        tmp_path,
        None,
        read_finished(found.out).T_level_sensor,
        DriveConfig(),
    )
    objects = read_sightings(stages / "tracks.json")
    (group, *_) = completer.missing(objects)
    completer(group)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*.ply")}
    assert before
    lost = next(iter(before)).parents[1]
    shutil.rmtree(lost)
    assert completer.missing(objects)[0] == group
    predictor, asked = completer.predictor, []

    def together(alone, scans, rays, motion):
        asked.append((scans, rays))
        assert len(motion.rotation) == len(motion.seconds) == len(scans)
        return Predictor.put_together(predictor, alone, scans, rays, motion)

    monkeypatch.setattr(predictor, "put_together", together)
    completer(group)
    assert any(len(scans) > 1 for scans, _ in asked)
    for scans, rays in asked:
        assert len(rays) == len(scans)
        assert (None in rays) == (len(scans) == 1)
    assert {file: file.read_bytes() for file in tmp_path.rglob("*.ply")} == before
