# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive's page: points where they were measured; played and clicked in a browser."""

import base64
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from tests.drives.finished_drive import CARS, FRAMES, HEIGHT, finished_drive
from tests.refusal import refused
from tests.report.chromium import CHROMIUM, Page, browser, colourful, eventually, moved

from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply
from wildshape.parallel import processes
from wildshape.parallel.team import team
from wildshape.report.drive.page import drive_report, report_from_drive, write_drive_report
from wildshape.report.drive.scene import NOBODY, SceneConfig, drawn_scans, scene_data


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return finished_drive(tmp_path_factory.mktemp("drive"))


def test_points_belong_to_the_vehicles_they_were_measured_on(found):
    drive = found.open_source()
    assert drive.motion is not None  # scans are corrected as the boxes were
    scans = drawn_scans(found, drive)
    assert [scan.frame for scan in scans] == list(range(FRAMES))
    for scan in scans:
        assert (scan.points[scan.owners == NOBODY][:, 2] < 0.16 - HEIGHT).all()
        for number, places in enumerate(CARS.values()):
            own = scan.points[scan.owners == number]
            assert len(own) > 100
            assert (own[:, 2] > 0.14 - HEIGHT).all()  # not the ground under it
            x, y, _ = places[scan.frame]
            assert np.abs(own[:, :2].mean(0) - (x - scan.frame, y)).max() < 0.4


def test_a_long_drive_is_drawn_within_its_limits(found):
    config = SceneConfig(frames=3, points=600, points_a_vehicle=20, shape_points=60)
    scans = drawn_scans(found, found.open_source(), config)
    assert [scan.frame for scan in scans] == [0, 2, 4]
    assert all((scan.owners == NOBODY).sum() == 200 for scan in scans)
    assert all((scan.owners != NOBODY).sum() == 40 for scan in scans)
    crowded = replace(config, vehicle_points=90)  # of 3 frames of 2 vehicles
    thinner = drawn_scans(found, found.open_source(), crowded)
    assert all((scan.owners != NOBODY).sum() == 30 for scan in thinner)
    data = scene_data(found, scans, config)
    assert [one["shape"]["count"] for one in data["vehicles"]] == [30, 30]
    standing, coming = data["vehicles"]
    assert coming["places"][2] == pytest.approx([26.8, -2.0, 0.75 - HEIGHT, 3.0], abs=2e-3)
    assert (standing["speeds"][1], coming["speeds"][1]) == (0.0, 8.0)


def test_a_vehicle_between_the_frames_drawn_is_drawn_where_it_is_fullest(found):
    """Its row led to a scene without it."""
    standing, coming = found.vehicles
    short = replace(coming, frames=(3, 4), boxes=coming.boxes[3:5], points=(200, 100))
    at_once = replace(short, frames=(3,), boxes=short.boxes[:1], points=(90,))
    brief = replace(found, vehicles=(standing, short, at_once))
    config = SceneConfig(frames=1)
    scans = drawn_scans(brief, found.open_source(), config)
    assert [scan.frame for scan in scans] == [0, 3]
    assert [(scan.owners > 0).sum() > 100 for scan in scans] == [False, True]
    vehicles = scene_data(brief, scans, config)["vehicles"]
    assert [one["points"] for one in vehicles] == [[200, 200], [200], [90]]
    assert [one["first"] for one in vehicles] == [0, 1, 1]
    assert all(any(one["places"]) for one in vehicles)


def test_the_scene_s_points_lie_in_the_level_world_where_they_stand(found):
    """As the page unpacks them: little-endian int16 in steps along each axis, then the pose."""
    data = scene_data(found, drawn_scans(found, found.open_source()))
    assert data["ground"] == HEIGHT
    assert data["way"] == [[frame, 0, 0] for frame in range(FRAMES)]
    assert [one["moving"] for one in data["vehicles"]] == [False, True]
    for frame, drawn in enumerate(data["frames"]):
        assert (drawn["frame"], drawn["time"]) == (frame, pytest.approx(0.1 * frame))
        packed = np.frombuffer(base64.b64decode(drawn["points"]), "<i2").reshape(-1, 3)
        points = (packed + 32767.0) * drawn["step"] + drawn["low"]
        pose = np.array(drawn["pose"])
        placed = points @ pose[:, :3].T + pose[:, 3]
        owners = np.array(drawn["owners"])
        cars = placed[-len(owners) :]
        for number, places in enumerate(CARS.values()):
            own = cars[owners == number]
            x, y, _ = places[frame]
            assert np.abs(own[:, :2].mean(0) - (x, y)).max() < 0.4


def test_without_times_no_seconds_and_no_speeds_are_shown(found):
    """Those of ten scans a second were, as if they had been measured."""
    untimed = replace(found, times=None)
    report = drive_report(untimed, None)
    assert [name for name, _ in report.facts if name == "time"] == []
    assert "seen, frames" in report.index[0].columns
    assert [row[10] for row in report.index[0].rows] == ["0 to 5"] * 2
    scene = scene_data(untimed, drawn_scans(untimed, None))
    assert not scene["timed"]
    assert [one["speeds"] for one in scene["vehicles"]] == [None, None]


def test_each_vehicle_s_scans_are_fused_where_it_is_completed(found, tmp_path):
    """In the frame of its fullest, here the second of two: what drives was elsewhere before."""
    out = shutil.copytree(found.out, tmp_path / "found")
    for name in CARS:
        first = out / "tracks" / name / "scans" / "000001.ply"
        write_ply(first, read_points(first)[:150])
    report = report_from_drive(out)
    assert [shown.name for shown in report.objects] == list(CARS)
    assert all(report.index[0].columns)
    assert [row[1] for row in report.index[0].rows] == ["standing", "moving"]
    assert [row[2:6] for row in report.index[0].rows] == [("0.90", "0.97", "0.94", "0.99")] * 2
    assert [row[6:] for row in report.index[0].rows] == [
        ("4.40", "1.80", "1.50", FRAMES, "0.0 to 0.5", nearest, 200) for nearest in ("7.9", "21.1")
    ]
    assert "That of what is seen driving is raised" in report.index[0].caption
    assert "a strange thing" in report.notes
    assert [value for _, value in report.facts] == ["2", "1", "6", "0.5 s", "5 m"]
    assert report.cost == (
        ("all of it", "4 s"),
        ("trajectory", "1.5 s"),
        ("completion", "2.5 s"),
    )
    for shown in report.objects:
        assert shown.subtitle == "scan 000003, 2 scans completed together"
        assert ("frames", "0 to 5") in shown.details
        assert ("kind right", "0.99") in shown.details
        assert shown.box is not None
        for cloud in shown.clouds:
            reach = np.abs(cloud.points - np.asarray(shown.box.centre)).max(0)
            assert (reach < (2.6, 1.5, 0.8)).all(), cloud.label


def test_helpers_draw_the_same_page(found, monkeypatch):
    monkeypatch.setattr(processes, "_WORTH_S", 0.0)
    with team(2, soon="wildshape.report.drive.page") as helpers:
        together = report_from_drive(found.out, helpers=helpers)
        while helpers.worked == 1:
            together = report_from_drive(found.out, helpers=helpers)
    alone = report_from_drive(found.out)
    assert alone.scene is not None
    assert together.scene is not None
    assert together.scene.picture == alone.scene.picture
    assert together.scene.data == alone.scene.data
    assert [shown.details for shown in together.objects] == [s.details for s in alone.objects]


def test_without_the_recording_the_vehicles_are_drawn_alone(found, tmp_path):
    out = shutil.copytree(found.out, tmp_path / "found")
    said = json.loads((out / "wildshape.json").read_text())
    said["settings"]["source"] = str(tmp_path / "gone")
    (out / "wildshape.json").write_text(json.dumps(said))
    report = report_from_drive(out)
    one = drive_report(replace(found, vehicles=found.vehicles[:1]), None)
    assert [dict(page.facts)["of them moving"] for page in (report, one)] == ["1", "0"]
    assert any("no scans are drawn" in note for note in report.notes)
    assert len(report.objects) == len(CARS)
    assert report_from_drive(out, found.source).notes == report.notes[1:]
    refused(report_from_drive, out, tmp_path / "nowhere", match="nowhere")
    refused(report_from_drive, tmp_path, match="name one, such as .*found")
    (tmp_path / "few").mkdir()
    shutil.copy(found.source / "000000.npy", tmp_path / "few")
    refused(report_from_drive, out, tmp_path / "few", match="1 scans")


def test_a_page_says_that_an_adapted_model_made_it(found, tmp_path):
    out = shutil.copytree(found.out, tmp_path / "found")
    said = json.loads((out / "wildshape.json").read_text())
    (out / "wildshape.json").write_text(json.dumps({**said, "adapted": "4e07bcce7285b479"}))
    first, second = (report_from_drive(folder).notes for folder in (found.out, out))
    (note,) = set(second) - set(first)
    assert "are of a model adapted" in note


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("wildshape.json", {"result": [1]}),
        ("wildshape.json", {"result": {"seconds": {"tracks": "x"}}}),
        ("wildshape.json", {"result": {"warnings": "x"}}),
        ("wildshape.json", {"provenance": [1]}),
        ("objects/0003/objects.json", {"scans": []}),
    ],
)
def test_a_drive_whose_records_were_changed_is_refused(found, tmp_path, name, damage):
    """A traceback, or letters for warnings."""
    out = shutil.copytree(found.out, tmp_path / "found")
    said = json.loads((out / name).read_text())
    (out / name).write_text(json.dumps({**said, **damage}))
    refused(report_from_drive, out, match=name)


def test_a_page_says_which_vehicle_s_scans_are_lost(found, tmp_path):
    out = shutil.copytree(found.out, tmp_path / "found")
    lost, whole = CARS
    scan = out / "tracks" / lost / "scans" / "000003.ply"
    scan.write_bytes(scan.read_bytes()[:40])
    said = {shown.name: shown.subtitle for shown in report_from_drive(out).objects}
    assert said[lost].endswith("; 1 of them cannot be read any more")
    assert said[whole].endswith("completed together")
    boxes = (out / "boxes.csv").read_text()  # what another vehicle took was not lost
    (out / "boxes.csv").write_text(re.sub(rf"(?m)^(3,.*,{lost},.*),\d+,(\d)$", r"\1,0,\2", boxes))
    said = {shown.name: shown.subtitle for shown in report_from_drive(out).objects}
    assert said[lost].endswith("completed together")


@pytest.mark.skipif(CHROMIUM is None, reason="did not run: no chromium on PATH")
def test_the_scene_plays_and_a_click_on_a_vehicle_opens_it(found, tmp_path):
    write_drive_report(found.out)
    with browser(tmp_path / "profile") as page:
        page.open((found.out / "report.html").as_uri())
        page.wait("document.querySelector('#drive_now')?.textContent.includes('of 0.5 s')")
        place = page.ask(
            "(({x, y, width, height}) => ({x, y, width, height}))"
            "(document.querySelector('#drive_canvas').getBoundingClientRect())"
        )
        clip = {**place, "scale": 1}
        eventually(lambda: page.shot(clip=clip), lambda p: colourful(p) > 400, "nothing is drawn")
        before = page.shot(clip=clip)
        page.ask("[...document.querySelectorAll('#drive_views button')][0].click()")
        eventually(lambda: page.shot(clip=clip), lambda p: moved(p, before) > 0.01, "not above")
        labels = "[...document.querySelectorAll('#drive_labels span')]"
        label = f"{labels}.find(one => one.textContent === '<7>')"
        page.wait(f"!!{label}")
        x, y = page.ask(f"(e => [e.left + e.width / 2, e.bottom])({label}.getBoundingClientRect())")
        mouse = {"x": x, "y": y, "button": "left", "clickCount": 1}
        page.call("Input.dispatchMouseEvent", type="mousePressed", **mouse)
        page.call("Input.dispatchMouseEvent", type="mouseReleased", **mouse)
        page.wait("document.querySelector('#drive_card h3')?.textContent === '<7>'")
        assert "8.0 m/s" in page.ask("document.querySelector('#drive_card').textContent")
        assert page.ask("document.querySelector('#name').textContent") == "<7>"
        page.ask("document.querySelectorAll('tr[data-object]')[0].click()")
        page.wait("document.querySelector('#drive_card h3').textContent === '0003'")
        page.ask("document.querySelector('#drive_play').click()")
        page.wait("document.querySelector('#drive_now').textContent == 'frame 5, 0.5 of 0.5 s'")
        assert page.ask(_SOUGHT) == 1, "the slider does nothing while the scene plays"
        _check_on_a_phone(page)
        assert page.complaints() == []
        assert [url for url in page.loads() if not url.startswith(("file:", "data:"))] == []


_SOUGHT = """(() => {
  const time = document.querySelector('#drive_time');
  const real = [requestAnimationFrame, performance.now];
  const later = [], until = (at) => { clock = at; later.splice(0).forEach((act) => act(at)); };
  let clock = 0;
  window.requestAnimationFrame = (act) => later.push(act);
  performance.now = () => clock;
  document.querySelector('#drive_play').click();
  until(350);
  time.value = 1;
  time.dispatchEvent(new Event('input'));
  until(370);
  [window.requestAnimationFrame, performance.now] = real;
  document.querySelector('#drive_play').click();
  return Number(time.value);
})()"""


def _resize(page: Page, width: int) -> None:
    page.call(
        "Emulation.setDeviceMetricsOverride",
        width=width, height=800, deviceScaleFactor=1, mobile=False,
    )  # fmt: skip


def _check_on_a_phone(page: Page) -> None:
    """Scale and legend have their own places; names are whole, however near the edge."""
    _resize(page, 390)
    page.wait("innerWidth == 390")
    place = "document.querySelector('#drive_{}').getBoundingClientRect()"
    low, top = place.format("scale"), place.format("legend")
    assert page.ask(f"{low}.bottom <= {top}.top || {low}.right <= {top}.left")
    page.ask("[...document.querySelectorAll('#drive_views button')][2].click()")
    stage = place.format("labels")
    inside = f"(e => e.left >= {stage}.left - 1 && e.right <= {stage}.right + 1)"
    spans = "[...document.querySelectorAll('#drive_labels span')]"
    for _ in range(30):  # they pass the edge as the view comes closer
        page.ask("document.querySelector('#drive_closer').click()")
        page.wait(f"{spans}.every(s => {inside}(s.getBoundingClientRect()))")  # once it is drawn


@pytest.mark.skipif(CHROMIUM is None, reason="did not run: no chromium on PATH")
def test_the_first_view_shows_every_vehicle(tmp_path):
    far = {"a": (-30.0, 14.0, 0.2), "b": (30.0, -14.0, 0.1), "c": (0.0, -18.0, 0.1)}
    found = finished_drive(tmp_path, {name: [place] * FRAMES for name, place in far.items()})
    write_drive_report(found.out)
    with browser(tmp_path / "profile") as page:
        page.open("about:blank")
        for width in (1280, 390):
            _resize(page, width)
            page.call("Page.navigate", url=(found.out / "report.html").as_uri())
            spans = "[...document.querySelectorAll('#drive_labels span')]"
            page.wait(f"innerWidth == {width} && {spans}.length")
            assert set(page.ask(f"{spans}.map(e => e.textContent)")) == {*far, "sensor"}
