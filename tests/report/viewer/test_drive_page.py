# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The viewer of a drive: the scene at a time, and the vehicle that is chosen."""

import json
import math
import shutil
from dataclasses import replace
from urllib.request import urlopen

import numpy as np
import pytest
import torch
from tests.drives.finished_drive import CARS, HEIGHT, SIZE, finished_drive, poses_alive

pytest.importorskip("viser", reason="did not run: viser is not installed (extra view)")
from wildshape.cli.main import main
from wildshape.drives.writing.finished import read_finished
from wildshape.drives.writing.playback.moments import colour_of
from wildshape.geometry.transforms.se3 import SE3
from wildshape.report.drive.scene import SceneConfig
from wildshape.report.viewer import drive_page
from wildshape.report.viewer import page as pages
from wildshape.report.viewer.drive_page import NOTHING, measured, serving_drive

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")  # viser's


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return finished_drive(tmp_path_factory.mktemp("drive"))


def test_what_is_held_and_sent_of_many_vehicles_is_bounded(found, monkeypatch):
    monkeypatch.setattr(drive_page, "_CONFIG", SceneConfig(shape_points=60))
    before = poses_alive()
    with serving_drive(found) as page:
        assert [len(node["shapes"].points) for node in page.nodes] == [30, 30]
        assert poses_alive() - before < len(page.found)  # of two vehicles in each of the frames


def test_the_time_is_shown_where_it_is_known(found):
    for drive, said in ((found, True), (replace(found, times=None), False)):
        with serving_drive(drive) as page:
            page.refresh()
            assert (">time<" in page.text.content) == said


def test_vehicles_stand_at_their_places_and_the_chosen_one_shows_its_shape(found):
    with serving_drive(found) as page:
        page.time.value = 4
        page.refresh()
        for node, (x, y, _) in zip(page.nodes, (places[4] for places in CARS.values())):
            assert node["place"].visible
            at = (x, y, SIZE[2] / 2 - HEIGHT)
            assert np.asarray(node["place"].position) == pytest.approx(at, abs=1e-4)
        assert np.asarray(page.sensor.position) == pytest.approx((4, 0, 0))
        assert len(page.scan.points) > 1000
        page.layers["boxes"].value = False
        page.refresh()
        assert not page.nodes[0]["boxes"].visible
        page.picker.value = "<7>"
        page.choose()
        whole, around = page.extra
        assert len(whole.points) == 800
        assert (np.abs(around.points).max(0) <= np.array(SIZE) / 2 + 0.01).all()
        assert "&lt;7&gt;" in page.text.content
        assert "0.94" in page.text.content.partition("box right")[2]
        assert np.linalg.norm(page.server.initial_camera.look_at - [26.8, -2, -0.95]) < 0.01
        for name, handle in (("shapes", whole), ("scan", around)):
            page.layers[name].value = False
            page.refresh()
            assert not handle.visible
            page.layers[name].value = True
            page.refresh()
            assert handle.visible
        page.picker.value = NOTHING
        page.choose()
        assert page.extra == []


def test_a_scan_is_coloured_by_height_and_by_the_vehicle_that_it_is_on(found):
    with serving_drive(found) as page:
        start, *_, end = page.ways[0].points.reshape(-1, 3)  # below the sensor
        np.testing.assert_allclose((start, end), ((0, 0, -HEIGHT), (5, 0, -HEIGHT)), atol=1e-6)
        page.time.value = 4
        page.refresh()
        points, colours = page.scan.points, page.scan.colors.astype(int)
        high = points[:, 2] > 0.3 - HEIGHT
        for number, places in enumerate(CARS.values()):
            x, y, _ = places[4]
            on = high & (np.linalg.norm(points[:, :2] - [x - 4, y], axis=1) < max(SIZE))
            assert on.sum() > 50
            bright = 0.45 * np.array(colour_of(number)) + 140
            assert np.abs(colours[on] - bright).max() <= 1
        page.boxes = {}
        page.time.value = 3
        page.refresh()
        grey = 70 + 130 * (page.scan.points[:, 2:] + HEIGHT) / 4  # by the height above the ground
        assert np.abs(page.scan.colors - grey).max() <= 1.01


def test_grey_is_by_height_where_the_sensor_is_tilted(found):
    """What lies 20 m ahead of one that looks 10 degrees up is 3.5 m higher than it measures."""
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    up = torch.tensor(((c, 0, -s), (0, 1, 0), (s, 0, c))).double()
    T_level_sensor = found.T_level_sensor @ SE3(up, torch.zeros(3).double())
    with serving_drive(replace(found, T_level_sensor=T_level_sensor, vehicles=())) as page:
        x, _, z = page.scan.points.T
        height = (s * x + c * z + HEIGHT).clip(0, 4)
        assert np.ptp(height) > 3
        assert np.abs(page.scan.colors - (70 + 130 * height[:, None] / 4)).max() <= 1.01


def test_a_vehicle_is_seen_in_its_own_frames_alone(found):
    late, always = found.vehicles
    late = replace(late, frames=late.frames[3:], boxes=late.boxes[3:], points=late.points[3:])
    with serving_drive(replace(found, vehicles=(late, always))) as page:
        for frame in (0, 5, 2, 3):
            page.time.value = frame
            page.refresh()
            seen = [node["place"].visible for node in page.nodes]
            assert seen == [frame >= 3, True]
            assert f"{sum(seen)} here, 2 in all" in page.text.content


def test_scans_of_a_vehicle_are_laid_over_each_other_in_its_box(found):
    points = measured(found, found.vehicles[1])
    assert len(points) == 2 * 200
    assert (np.abs(points).max(0) <= np.array(SIZE) / 2 + 0.01).all()


def test_the_command_serves_a_drive_s_folder(found, monkeypatch, capsys):
    def once(page):
        with urlopen(page.url) as answer:
            assert answer.status == 200
        raise KeyboardInterrupt

    monkeypatch.setattr(pages, "run_until_interrupted", once)
    main(["view", str(found.out), "--no-open", "--port", "0", "--json"])
    assert json.loads(capsys.readouterr().out)["tracks"] == len(CARS)


def test_a_recording_that_has_moved_is_shown_from_where_it_is_now(found, tmp_path):
    moved = shutil.copytree(found.source, tmp_path / "moved")
    said = json.loads((found.out / "wildshape.json").read_text())
    said["settings"]["source"] = str(tmp_path / "gone")
    out = shutil.copytree(found.out, tmp_path / "out")
    (out / "wildshape.json").write_text(json.dumps(said))
    with serving_drive(read_finished(out)) as page:
        assert page.scan is None
    with serving_drive(read_finished(out), moved=moved) as page:
        assert len(page.scan.points) > 1000


def test_a_vehicle_that_is_gone_is_said_on_the_page(tmp_path):
    found = finished_drive(tmp_path)
    with serving_drive(found) as page:
        shutil.rmtree(found.out)
        page.picker.value = "<7>"
        assert "no such file" in page.text.content
        page.picker.value = NOTHING
        assert "click a vehicle" in page.text.content


def test_a_folder_that_was_written_anew_is_not_mixed_with_what_is_shown(tmp_path):
    found = finished_drive(tmp_path)
    with serving_drive(found) as page:
        said = json.loads((found.out / "wildshape.json").read_text())
        said["result"]["seconds"]["completion"] = 3.5
        (found.out / "wildshape.json").write_text(json.dumps(said))
        page.picker.value = "<7>"
        assert "written anew" in page.text.content
        assert page.extra == []


def test_a_scan_that_can_no_longer_be_read_is_said_on_the_page(tmp_path):
    found = finished_drive(tmp_path)
    with serving_drive(found) as page:
        assert "cannot be read" not in page.text.content
        shutil.rmtree(found.source)
        page.time.value = 4
        assert "cannot be read" in page.text.content
