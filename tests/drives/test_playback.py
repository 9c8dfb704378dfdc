# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of a drive for other viewers, read back by the formats' own libraries."""

import shutil
import sys
from collections import defaultdict
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
import torch
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from tests.drives.finished_drive import CARS, FRAMES, HEIGHT, SIZE, finished_drive, poses_alive
from tests.refusal import refused

from wildshape.drives.completing.level_frame import boxes_in_scans
from wildshape.drives.source import Drive
from wildshape.drives.tracking.detections import DetectionFile, find_detections
from wildshape.drives.writing.files import DriveFiles, detections_of
from wildshape.drives.writing.finished import read_finished
from wildshape.drives.writing.playback.mcap import write_mcap
from wildshape.drives.writing.playback.moments import moments
from wildshape.drives.writing.playback.rerun import write_rerun
from wildshape.errors import MissingExtraError
from wildshape.geometry.transforms.rotation import rotation_from_vector
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.io.boxes.table import BoxRow, write_box_table
from wildshape.io.poses import write_poses
from wildshape.records import Turn


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    drive = finished_drive(tmp_path_factory.mktemp("drive"))
    table = drive.out / "boxes.csv"  # the car that comes is not seen in the last frame
    lines = table.read_text().splitlines()
    table.write_text("\n".join(line for line in lines if not line.startswith("5,0.5,<7>")) + "\n")
    drive = read_finished(drive.out)
    DriveFiles(mcap=True, rerun=find_spec("rerun") is not None).write(drive.out)
    return drive


def test_a_long_drive_s_poses_are_not_held_one_by_one(found):
    before = poses_alive()
    playing = moments(found)
    assert len(next(playing).present) == len(CARS)
    assert poses_alive() - before < FRAMES  # of two vehicles in each of them


@pytest.fixture(scope="module")
def messages(found):
    """(log time, message) by topic."""
    by_topic = defaultdict(list)
    with (found.out / "drive.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            by_topic[channel.topic].append((message.log_time, decoded))
    return by_topic


def cloud(message):
    """Columns by name, as the message says where they lie."""
    kinds = {1: "u1", 7: "<f4"}
    fields = {one.name: (kinds[one.type], one.offset) for one in message.fields}
    formats, offsets = zip(*fields.values())
    step = message.point_stride
    layout: Any = {"names": [*fields], "formats": formats, "offsets": offsets, "itemsize": step}
    return np.frombuffer(message.data, np.dtype(layout))


def test_mcap_holds_every_frame_on_every_topic(messages):
    assert {topic: len(found) for topic, found in messages.items()} == {
        "/tf": FRAMES,
        "/boxes": FRAMES,
        "/shapes": FRAMES,
        "/scan": FRAMES,
        "/trajectory": 1,
    }
    assert [time for time, _ in messages["/scan"]] == [10**8 * frame for frame in range(FRAMES)]
    (_, way), *_ = messages["/trajectory"]
    assert [pose.position.x for pose in way.poses] == pytest.approx(range(FRAMES))
    for frame, (_, moved) in enumerate(messages["/tf"]):
        assert (moved.parent_frame_id, moved.child_frame_id) == ("world", "sensor")
        assert (moved.translation.x, moved.rotation.w) == pytest.approx((frame, 1))


def test_mcap_boxes_and_shapes_stand_where_the_cars_are(messages):
    for frame, (_, update) in enumerate(messages["/boxes"]):
        there = list(CARS)[: 1 if frame == 5 else 2]
        assert [entity.id for entity in update.entities] == there
        assert len(update.deletions) == 1
        for entity in update.entities:
            x, y, yaw = CARS[entity.id][frame]
            (cube,) = entity.cubes
            assert (cube.size.x, cube.size.y, cube.size.z) == pytest.approx(SIZE)
            place, turn = cube.pose.position, cube.pose.orientation
            assert (place.x, place.y, place.z) == pytest.approx((x, y, SIZE[2] / 2 - HEIGHT))
            assert np.cos(2 * np.arctan2(turn.z, turn.w) - yaw) == pytest.approx(1)
            assert entity.texts[0].text == entity.id
        shapes = cloud(messages["/shapes"][frame][1])
        places = np.array([CARS[name][frame][:2] for name in there])
        points = np.column_stack((shapes["x"], shapes["y"]))
        away = np.linalg.norm(points[:, None] - places, axis=2).min(1)
        assert away.max() < 2.5
        assert len(np.unique(shapes[["red", "green", "blue"]])) == len(there)
        scan = cloud(messages["/scan"][frame][1])
        assert scan["z"].min() == np.float32(-HEIGHT)


def test_mcap_says_speeds_only_where_times_are_known(found, messages, tmp_path):
    """A drive without times had those of ten scans a second."""

    def said(updates):
        return {pair.key for one in updates for pair in one.entities[-1].metadata}

    assert "speed" in said(update for _, update in messages["/boxes"])
    write_mcap(replace(found, times=None), tmp_path / "untimed.mcap")
    with (tmp_path / "untimed.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        boxes = [message for *_, message in reader.iter_decoded_messages(["/boxes"])]
    assert len(boxes) == FRAMES
    assert "speed" not in said(boxes)


def test_mcap_rises_from_0_where_times_begin_before_it(found, tmp_path):
    early = replace(found, times=tuple(time - 3.05 for time in found.times))
    write_mcap(early, tmp_path / "early.mcap")
    with (tmp_path / "early.mcap").open("rb") as file:
        scans = [message.log_time for *_, message in make_reader(file).iter_messages("/scan")]
    assert scans == [10**8 * frame for frame in range(FRAMES)]


def test_a_scan_named_by_its_time_keeps_it_to_the_nanosecond(found):
    stamps = [315966265259836000 + 99_999_999 * frame for frame in range(FRAMES)]
    names, times = tuple(map(str, stamps)), tuple(stamp / 1e9 for stamp in stamps)
    named = replace(found, scan_names=names, times=times)
    assert {one.time_ns for one in detections_of(named)} == set(stamps)


@pytest.mark.parametrize("first", [7, 1700000000123456, 1])
def test_kitti_labels_of_a_drive_are_found_again(found, tmp_path, first):
    names = [f"{first + frame:012d}" for frame in range(FRAMES)]
    if first == 1:  # the last scan's place is the number of the one before it
        names[-1] = "once more"
    named = replace(found, scan_names=tuple(names))
    drive = Drive.of("drive", names, lambda _: Turn(np.empty((0, 3), np.float32)))
    BoxFiles(("kitti",)).write_detections(tmp_path, list(detections_of(named)))
    again = find_detections(DetectionFile(tmp_path / "boxes" / "kitti"), drive)
    for frame, boxes in enumerate(again.frames):
        seen = [one for one in found.vehicles if frame in one.frames]
        for box, one in zip(boxes, seen, strict=True):
            true = one.boxes[one.frames.index(frame)].centre
            assert box.box.centre == pytest.approx(true, abs=1e-5)


@pytest.mark.parametrize(
    ("names", "numbers"),
    [(("0007", "0012"), {7, 12}), (("0007", "0012+1"), {0, 1}), (("7", "007"), {0, 1})],
)
def test_tracks_are_numbered_by_names_that_count(found, names, numbers):
    vehicles = tuple(replace(one, name=name) for one, name in zip(found.vehicles, names))
    named = detections_of(replace(found, vehicles=vehicles))
    assert {one.track_number for one in named} == numbers


def test_rerun_holds_boxes_shapes_scans_and_the_way(found):
    read = pytest.importorskip("rerun.chunk", reason="did not run: rerun-sdk is not installed")
    rows = defaultdict(int)
    for chunk in read.RrdReader(str(found.out / "drive.rrd")).stream():
        if not chunk.entity_path.startswith("/__"):
            for name in chunk.to_record_batch().schema.names:
                rows[chunk.entity_path, name] += chunk.num_rows
    paths = {path for path, _ in rows}
    assert {"/world/way", "/world/sensor", "/world/sensor/scan"} <= paths
    assert rows["/world/sensor/scan", "Points3D:positions"] == FRAMES
    for name, escaped, seen in (("0003", "0003", FRAMES), ("<7>", r"\<7\>", FRAMES - 1)):
        assert rows[f"/world/vehicles/{escaped}", "Transform3D:translation"] == seen, name
        assert rows[f"/world/vehicles/{escaped}/box", "Boxes3D:half_sizes"] == 1
        assert rows[f"/world/vehicles/{escaped}/shape", "Points3D:positions"] == 1
    assert rows[r"/world/vehicles/\<7\>", "Clear:is_recursive"] == 1


def test_rerun_s_grey_is_by_height_where_the_sensor_is_tilted(found, tmp_path):
    """What lies 20 m ahead of one that looks 10 degrees up is 3.5 m higher than it measures."""
    read = pytest.importorskip("rerun.chunk", reason="did not run: rerun-sdk is not installed")
    up = rotation_from_vector(torch.deg2rad(torch.tensor((0.0, -10.0, 0.0)).double()))
    T_level_sensor = found.T_level_sensor @ SE3(up, torch.zeros(3).double())
    tilted = replace(found, T_level_sensor=T_level_sensor, vehicles=())
    write_rerun(tilted, tmp_path / "drive.rrd")
    for chunk in read.RrdReader(str(tmp_path / "drive.rrd")).stream():
        batch = chunk.to_record_batch()
        if "Points3D:colors" in batch.schema.names:
            points = np.array(batch.column("Points3D:positions")[0].as_py())
            colours = np.array(batch.column("Points3D:colors")[0].as_py())
            height = (points @ up.numpy()[2] + HEIGHT).clip(0, 4)
            assert np.ptp(height) > 3
            assert (colours >> 24) == pytest.approx(70 + 150 * height / 4, abs=1.01)
            break
    else:
        pytest.fail("no scan in it")


@pytest.mark.parametrize(
    ("module", "extra"), [("mcap_protobuf.writer", "mcap"), ("rerun", "rerun")]
)
def test_a_library_that_is_absent_is_named_before_any_work(monkeypatch, module, extra):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf"wildshape\[{extra}\]"):
        DriveFiles(mcap=extra == "mcap", rerun=extra == "rerun").check()


@pytest.mark.parametrize(
    ("file", "instead", "said"),
    [
        ("trajectory.tum", "", "5 poses for 6 scans"),
        ("frames.csv", "1,000001,,3400\n", "damaged"),
        ("frames.csv", "1,000001,0.5,3400\n", "its times do not rise"),
    ],
)
def test_a_drive_of_which_a_line_was_changed_is_refused(tmp_path, file, instead, said):
    """It would be read with the times of other scans."""
    path = finished_drive(tmp_path).out / file
    lines = path.read_text().splitlines(keepends=True)
    lines[2] = instead
    path.write_text("".join(lines))
    refused(read_finished, path.parent, match=f"{file}: .*{said}")


def test_boxes_seen_by_a_tilted_sensor_are_read_as_they_were(tmp_path):
    out = finished_drive(tmp_path).out
    tilted = torch.tensor([(0.1, -0.2, 0.3 * frame) for frame in range(FRAMES)]).double()
    T_world_sensor = SE3(rotation_from_vector(tilted), torch.ones(FRAMES, 3).double())
    places = np.tile((9.0, -4.0, -0.8, 2.5), (FRAMES, 1))
    boxes = boxes_in_scans(places, SIZE, T_world_sensor)
    write_poses(out / "trajectory.txt", T_world_sensor)
    rows = [
        BoxRow(i, 0.1 * i, "a", *box.centre, *box.size, box.yaw, 0.9, 200, moving=False)
        for i, box in enumerate(boxes)
    ]
    write_box_table(out / "boxes.csv", rows)
    (found,) = read_finished(out).vehicles
    for one, box in zip(found.boxes, boxes, strict=True):
        assert one.centre == pytest.approx(box.centre, abs=1e-3)
        assert one.quaternion_wxyz == pytest.approx(box.quaternion_wxyz, abs=1e-3)


def test_without_the_recording_there_are_no_scans(found, tmp_path):
    kept = shutil.move(found.source, tmp_path / "moved")
    DriveFiles(mcap=True).write(found.out)
    shutil.move(kept, found.source)
    with (found.out / "drive.mcap").open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert topics == {"/tf", "/boxes", "/shapes", "/trajectory"}


@pytest.mark.parametrize(
    ("source", "name"),
    [("day/2026.11.27", "2026.11.27"), ("day/a.b.pcap", "a.b"), ("day/street", "street")],
)
def test_a_drive_bears_the_whole_name_of_its_folder(found, source, name):
    assert replace(found, record={"settings": {"source": source}}).name == name
