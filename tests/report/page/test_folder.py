# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.refusal import refused

from wildshape.evaluation.drives.found import Found, FoundDrive
from wildshape.evaluation.drives.labels import Counting, Label, LabelledDrive, LabelledFrame
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.protocol import evaluate_drives
from wildshape.evaluation.drives.results import write_results
from wildshape.evaluation.tables import COUNTED
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.poses import write_poses
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import write_track
from wildshape.records import Track
from wildshape.report.page.folder import report_from_folder
from wildshape.report.page.html import render
from wildshape.report.viewer.sources import from_results

NAMES = ("000000", "000001", "000002")


def _track() -> Track:
    """Three full views of one cloud of points, and the poses that explain them."""
    rng = np.random.default_rng(0)
    shape = (rng.uniform(-1, 1, (200, 3)) * (2, 0.9, 0.7)).astype(np.float32)
    yaw = torch.tensor([0.0, 0.5, 1.0], dtype=torch.float64)
    place = torch.tensor([[10.0, 2, 0], [11, 3, 0], [12, 4, 0]], dtype=torch.float64)
    T_sensor_object = SE3(rotation_z(yaw), place)
    scans = tuple(T_sensor_object[i].apply_numpy(shape) for i in range(3))
    return Track("0007", scans, NAMES, T_sensor_object=T_sensor_object, shape=shape)


def _completed(folder: Path, track: Track, objects: object) -> None:
    for name, scan in zip(NAMES, track.scans, strict=True):
        write_ply(folder / "completed" / f"{name}.ply", scan)
    write_poses(folder / "poses.txt", poses_of(track))
    (folder / "objects.json").write_text(json.dumps(objects), encoding="utf-8")


def _entry(name: str) -> dict:
    box = {"centre": [11, 3, 0], "size": [4, 1.8, 1.4], "quaternion_wxyz": [1, 0, 0, 0]}
    return {"scan": name, "box": box, "confidence": 0.75, "refined": True, "seconds": 0.02}


@pytest.mark.parametrize("moved", [False, True])
def test_track_is_fused_in_its_middle_scan_s_frame(tmp_path: Path, moved: bool) -> None:
    track = _track()
    write_track(tmp_path / "data" / "0007", track)
    place = tmp_path / ("gone" if moved else "data")
    objects = {"input": str(place), "scans": [_entry(name) for name in NAMES]}
    _completed(tmp_path / "out" / "0007", track, objects)
    shown = report_from_folder(tmp_path / "out", tmp_path / "data" if moved else None).objects[0]
    clouds = {cloud.label: cloud.points for cloud in shown.clouds}
    assert list(clouds) == ["input scan", "truth", "fused by us", "completed"]
    for points in (clouds["truth"], clouds["fused by us"][:200], clouds["fused by us"][-200:]):
        np.testing.assert_allclose(points, track.scans[1], atol=1e-4)
    np.testing.assert_array_equal(clouds["completed"], track.scans[1])
    assert shown.box is not None
    assert shown.box.size == (4, 1.8, 1.4)
    assert ("confidence", "0.75") in shown.details


def test_objects_to_look_at_come_first(tmp_path: Path) -> None:
    track = _track()
    assert track.T_sensor_object is not None
    for number, off in enumerate((0.0, 0.3, 0.1)):
        name = f"car{number}"
        write_track(tmp_path / "data" / name, replace(track, name=name))
        objects = {"input": str(tmp_path / "data"), "scans": [_entry(n) for n in NAMES]}
        _completed(tmp_path / "out" / name, track, objects)
        write_ply(tmp_path / "out" / name / "completed" / "000001.ply", track.scans[1] + off)
    report = report_from_folder(tmp_path / "out")
    assert [shown.name for shown in report.objects] == ["car1", "car2", "car0"]
    table = report.index[0]
    assert table.columns == ("object", "scans", "CD, m", "rotation, °", "least confidence")
    assert table.rows[2] == ("car0", 3, "0.000", "0.0", "0.75")
    assert table.objects == (0, 1, 2)
    assert ("CD to truth", "0.000 m") in report.objects[2].details
    scans = report.objects[0].scans
    assert scans is not None
    assert scans.rows[0] == ("000000", 200, "0.75", "4.00 × 1.80 × 1.40")  # noqa: RUF001
    # Only the middle scans' shapes were moved: they are what is measured, and what is said.
    assert any("true shape of 3 objects: their middle scans" in line for line in report.findings)
    assert "CD: of the middle scan's shape" in table.caption


def test_without_truth_the_least_confident_come_first(tmp_path: Path) -> None:
    for number, confidence in enumerate((0.9, 0.1, 0.4)):
        entries = [{**_entry(name), "confidence": confidence} for name in NAMES]
        _completed(tmp_path / f"car{number}", _track(), {"input": "", "scans": entries})
    report = report_from_folder(tmp_path)
    assert [row[0] for row in report.index[0].rows] == ["car1", "car2", "car0"]
    assert "least confidence" in report.index[0].title
    assert any("median confidence of 0.40; 6 of them" in line for line in report.findings)


def test_what_is_not_to_be_trusted_says_why(tmp_path: Path) -> None:
    entries = [_entry(name) for name in NAMES]
    entries[1] |= {"confidence": 0.4, "reasons": ["low_confidence"]}
    entries[2] |= {"confidence": 0.01, "reasons": ["poor_fit", "low_confidence"]}
    _completed(tmp_path / "wall", _track(), {"input": "", "scans": entries})
    report = report_from_folder(tmp_path)
    assert report.index[0].rows[0][-2:] == ("0.01", "poor fit, low confidence")
    assert any("Results not to be trusted: 2;" in line for line in report.findings)


def test_probabilities_of_the_least_sure_scan_are_shown(tmp_path: Path) -> None:
    entries = [_entry(name) for name in NAMES]
    for entry, chance in zip(entries, (0.9, 0.4, 0.8)):
        entry |= {"confidence": chance, "p_pose": chance, "p_box": 0.95, "p_kind": None}
    _completed(tmp_path / "car", _track(), {"input": "", "scans": entries})
    report = report_from_folder(tmp_path)
    columns = ("object", "scans", "least confidence", "heading right", "box right")
    assert report.index[0].columns == columns
    assert report.index[0].rows == (("car", 3, "0.40", "0.40", "0.95"),)
    assert "within 10° of the truth" in report.index[0].caption
    assert report.objects[0].details[:3] == (
        ("confidence", "0.40"),
        ("heading right", "0.40"),
        ("box right", "0.95"),
    )
    nowhere = {"centre": [0, math.nan, 0], "size": [4, 2, 1], "quaternion_wxyz": [1, 0, 0, 0]}
    for wrong in ({"p_pose": "high"}, {"scan": NAMES[0], "box": nowhere}):
        (tmp_path / "car" / "objects.json").write_text(json.dumps({"scans": [wrong]}))
        refused(report_from_folder, tmp_path, match=r"objects\.json")


def test_an_evaluation_s_objects_by_our_error(tmp_path: Path) -> None:
    def row(track: str, precision: float, degrees: float) -> dict[str, list]:
        where = {"track": track, "scan": "0"}
        error = {"precision": precision, "coverage": 0.1}
        turned = {"rotation_deg": degrees, "rotation_sym_deg": degrees, "translation_m": 0.1}
        completion = {**where, "error": error, "p_pose": 0.9, "p_box": None}
        return {"completions": [completion], "registrations": [{**where, **turned}]}

    def both(name: str, a: dict, b: dict) -> dict:
        return {"name": name, **{key: a[key] + b[key] for key in a}}

    ours = both("wildshape", row("a", 0.1, 3), row("b", 0.3, 90))
    runs = [{"methods": [both("identity", row("a", 0.5, 1), row("b", 0.1, 1)), ours]}]
    (tmp_path / "scores.json").write_text(json.dumps({"runs": runs}), encoding="utf-8")
    methods = {"identity": {"acc30": 0.31}, "dpc-lidar": {"acc30": 0.5}, "wildshape": {}}
    metrics = {"rotate": "yaw", "methods": methods}
    methods["wildshape"] = {"acc30": 0.996, "rot_median_deg": 3.0, "trans_median_m": 0.1}
    trust = {"p_pose_error": 0.02, "p_pose_brier": 0.05, "p_pose_brier_constant": 0.08}
    methods["wildshape"] |= trust
    (tmp_path / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
    report = report_from_folder(tmp_path)
    assert report.index[0].rows == (
        ("b", 1, "0.400", "0.400", "90.0", "0.10", "0.90"),
        ("a", 1, "0.200", "0.200", "3.0", "0.10", "0.90"),
    )
    assert report.tables[0].emphasis == (2,)
    reading = report.findings[0]
    assert "wildshape brings 99.6 % of them within 30°" in reading
    assert "best of the others: dpc-lidar, 50 %" in reading
    assert "a right heading that wildshape states is 2 % off" in report.findings[1]


def test_without_the_scans_only_the_completed_shape_is_shown(tmp_path: Path) -> None:
    objects = {"input": str(tmp_path / "gone"), "scans": [_entry("000001")]}
    _completed(tmp_path / "0007", _track(), objects)
    shown = report_from_folder(tmp_path).objects[0]
    assert [cloud.label for cloud in shown.clouds] == ["completed"]
    assert "cannot be read" in shown.subtitle
    assert ("time", "20 ms") in shown.details


def test_a_camera_s_shape_stands_upright_without_its_scans(tmp_path: Path) -> None:
    """It was drawn in a LiDAR's axes, from below."""
    said = {"input": str(tmp_path / "gone"), "sensor": "camera", "scans": [_entry("000001")]}
    _completed(tmp_path / "chair", _track(), said)
    assert report_from_folder(tmp_path).objects[0].sensor == "camera"
    assert from_results(tmp_path).track(0).sensor.kind == "camera"


def test_registered_only_and_in_millimetres(tmp_path: Path) -> None:
    track = _track()
    scans = tmp_path / "data" / "0007" / "scans"
    for name, scan in zip(NAMES, track.scans, strict=True):
        write_ply(scans / f"{name}.ply", scan * 1000)
    out = tmp_path / "out"
    _completed(out / "0007", track, {"input": str(tmp_path / "data")})
    shutil.rmtree(out / "0007" / "completed")
    (out / "wildshape.json").write_text('{"settings": {"unit": "mm"}}', encoding="utf-8")
    shown = report_from_folder(out).objects[0]
    assert [cloud.label for cloud in shown.clouds] == ["input scan", "fused by us"]
    np.testing.assert_allclose(shown.clouds[1].points[:200], track.scans[1], atol=1e-3)


def test_metrics_and_log_become_table_and_curves(tmp_path: Path) -> None:
    figures = {
        "cd": 0.312,
        "acc30": 0.82,
        "std": {"acc30": 0.013},
        "scans_counted": {"completion": 40, "registration": 42},
    }
    metrics = {
        "rotate": "yaw",
        "seeds": [0, 1],
        "methods": {"identity": {"cd": None, "acc30": 0.31}, "wildshape": figures},
        "provenance": {"commit": "abc"},
    }
    (tmp_path / "evaluation").mkdir()
    marked = "utf-8-sig"  # the byte order mark of a Windows editor
    (tmp_path / "evaluation" / "metrics.json").write_text(json.dumps(metrics), encoding=marked)
    lines = [
        {"step": i, "loss": 1 / i, "observation": 0.1, "branch_shares": [0.5, 0.5]} for i in (1, 2)
    ]
    truth = {"validation/truth_cd": 0.3, "validation/truth_rot_median_deg": 2.0}
    lines.append({"step": 2, "validation/cycle_deg": 4.0, **truth})
    (tmp_path / "run").mkdir()
    log = "".join(json.dumps(line) + "\n" for line in lines) + '{"step": 3, "lo'
    (tmp_path / "run" / "log.jsonl").write_text(log, encoding="utf-8")

    report = report_from_folder(tmp_path)
    table = report.tables[0]
    row = dict(zip(table.columns, table.rows[1], strict=True))
    assert table.emphasis == (1,)
    assert (row["method"], row["CD, m"], row[COUNTED]) == ("wildshape", "0.312", "40 / 42")
    assert row["acc 30, %"] == "82.0 ± 1.3"
    assert "rot, deg" not in row
    series = {c.title: [name for name, _, _ in c.series] for c in report.curves}
    assert series["Loss"] == ["loss", "observation"]
    assert series["Validation, cycle consistency"] == ["cycle"]
    against = {title: names for title, names in series.items() if "against truth" in title}
    assert list(against.values()) == [["truth_cd"], ["truth_rot_median"]]
    assert report.provenance == {"evaluation/metrics.json": {"commit": "abc"}}
    assert "Each scan turned by its own random yaw" in render(report)


@pytest.mark.parametrize(
    "content",
    [None, "{", "[]", '{"methods": 3}', "[" * 100_000],
    ids=["empty", "broken", "a list", "other", "deep"],
)
def test_folder_without_anything_to_report_is_refused(tmp_path: Path, content: str | None) -> None:
    if content is not None:
        (tmp_path / "metrics.json").write_text(content, encoding="utf-8")
    refused(report_from_folder, tmp_path, match=tmp_path.name)


def test_an_evaluation_of_drives_has_the_figures_of_its_table(tmp_path: Path) -> None:
    box = UprightBox(15.0, 2.0, -0.9, 4.0, 1.8, 1.5, 0.1)
    label = LabelledFrame((Label(4, True, box, True),), np.empty((0, 4)))
    labelled = LabelledDrive(Path("labels"), (label,) * 3, (), None, None, Counting())
    frames = ((Found("0", 0.9, box._replace(length=4.2)),), (Found("1", 0.8, box),), ())
    scores = evaluate_drives([FoundDrive(Path("none"), frames, None)], [labelled])
    written = write_results(tmp_path, scores, Counting(), {})
    lines = [line.strip("| ").split(" | ") for line in written.splitlines() if line[:1] == "|"]
    (table,) = report_from_folder(tmp_path).tables
    assert list(table.columns) == [*lines[0], *lines[5][1:]]
    assert list(table.rows[0]) == [*lines[2], *lines[7][1:]]
    assert "66.7" in table.rows[0]
    assert "3 labels of 1 vehicle with 100 points or more; 1 of them found." in table.caption


def test_scans_that_are_named_must_be_there(tmp_path: Path) -> None:
    _completed(tmp_path / "0007", _track(), {"scans": [_entry(name) for name in NAMES]})
    for read in (report_from_folder, from_results):
        refused(read, tmp_path, tmp_path / "absent", match="absent")
        for damaged in ({"settings": 3}, {"settings": {"unit": {}}}):
            (tmp_path / "wildshape.json").write_text(json.dumps(damaged), encoding="utf-8")
            refused(read, tmp_path, tmp_path / "absent", match=r"wildshape\.json")
        (tmp_path / "wildshape.json").unlink()


def test_the_middle_scan_against_itself_says_nothing_of_poses(tmp_path: Path) -> None:
    track = _track()
    poses = poses_of(track)
    write_track(tmp_path / "data" / "0007", track)
    objects = {"input": str(tmp_path / "data"), "scans": [_entry(n) for n in NAMES]}
    _completed(tmp_path / "out" / "0007", track, objects)
    turned = SE3(
        rotation_z(torch.deg2rad(torch.tensor((20.0, 0.0, 40.0)))).double(), 0 * poses.translation
    )
    write_poses(tmp_path / "out" / "0007" / "poses.txt", poses @ turned)
    (shown,) = report_from_folder(tmp_path / "out").objects
    assert ("median pose error", "30.0°") in shown.details


def test_missing_folder_is_refused(tmp_path: Path) -> None:
    refused(report_from_folder, tmp_path / "absent", match="no such folder")


@pytest.mark.parametrize(
    "scans",
    [7, [{"scan": "000001", "box": {"size": 3}}], [{"scan": "000001", "reasons": 0.5}]],
)
def test_damaged_objects_are_named(tmp_path: Path, scans: object) -> None:
    objects = {"input": str(tmp_path / "gone"), "scans": scans}
    _completed(tmp_path / "0007", _track(), objects)
    refused(report_from_folder, tmp_path, match=r"objects\.json")


@pytest.mark.parametrize("value", ["null", "[1]", '"x"', "1" + "0" * 400, "NaN", "[0.5, null]"])
def test_a_log_s_foreign_values_are_left_out(tmp_path: Path, value: str) -> None:
    good = '{"step": 1, "loss": 0.5, "branch_shares": [0.5, 0.5]}\n'
    bad = "[" * 100_000 + "\n"
    bad += f'{{"step": 2, "loss": {value}, "branch_shares": {value}}}\n{{"step": {value}}}\n'
    (tmp_path / "log.jsonl").write_text(good + bad, encoding="utf-8")
    series = {c.title: c.series for c in report_from_folder(tmp_path).curves}
    assert series["Loss"] == (("loss", [1.0], [0.5]),)


@pytest.mark.parametrize("made", [[1], 3.0, "x"])
def test_a_damaged_record_of_a_command_is_named(tmp_path: Path, made: object) -> None:
    _completed(tmp_path / "0007", _track(), {"scans": []})
    (tmp_path / "wildshape.json").write_text(json.dumps({"provenance": made}), encoding="utf-8")
    refused(report_from_folder, tmp_path, match=r"wildshape\.json: expected what a command says")


def test_the_curve_of_the_loss_shows_the_terms_of_any_objective(tmp_path: Path) -> None:
    line = {"step": 1, "loss": 3.0, "silhouette": 1.0, "student": 2.0, "steps_per_second": 9.0}
    (tmp_path / "log.jsonl").write_text(json.dumps(line) + "\n", encoding="utf-8")
    (curve,) = report_from_folder(tmp_path).curves
    assert [name for name, _, _ in curve.series] == ["loss", "silhouette", "student"]
    assert curve.y_label == "no unit"  # pixels, summed


def test_the_curves_of_two_runs_are_told_apart(tmp_path: Path) -> None:
    for run in ("first", "second"):
        (tmp_path / run).mkdir()
        (tmp_path / run / "log.jsonl").write_text('{"step": 1, "loss": 0.5}\n', "utf-8")
    first, second = report_from_folder(tmp_path).curves
    assert (first.title, second.title) == ("first: Loss", "second: Loss")
    assert first.y_label == "metres"


def test_the_floor_is_said_to_be_of_random_points(tmp_path: Path) -> None:
    """It is no bound: evenly spread points have less, and a figure may stand below it."""
    ours = {"cd": 0.011, "precision": 0.004, "coverage": 0.007, "cd_floor": 0.012}
    metrics = {"rotate": "none", "methods": {"wildshape": ours}}
    (tmp_path / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
    report = report_from_folder(tmp_path)
    assert "as many of the true surface, at random, would have 0.012 m" in report.findings[0]
    assert "drawn at random" in report.tables[0].caption
    assert "acc 30 and heading 30 are shares within 30°" in report.tables[0].caption


def test_each_of_several_evaluations_is_named(tmp_path: Path) -> None:
    for name, cd in (("cars", 0.1), ("trucks", 0.3)):
        (tmp_path / name).mkdir()
        ours = {"cd": cd, "precision": cd / 2, "coverage": cd / 2}
        metrics = {"rotate": "none", "methods": {"wildshape": ours}}
        (tmp_path / name / "metrics.json").write_text(json.dumps(metrics), encoding="utf-8")
        (tmp_path / name / "errors.png").write_bytes(b"")
        (tmp_path / name / "confidence.png").write_bytes(b"")
    report, alone = map(report_from_folder, (tmp_path, tmp_path / "cars"))
    assert ["distance of 0.100" in line for line in report.findings] == [True, False]
    for shown in (
        report.findings,
        *([x.title for x in f] for f in (report.tables, report.figures[::2])),
    ):
        assert [text.partition(": ")[0] for text in shown] == ["cars", "trucks"]
    assert alone.tables[0].title == "Scans as recorded"
    # two panels and more are read only as wide as the page
    assert [(x.title, x.wide) for x in alone.figures] == [("confidence", False), ("errors", True)]
