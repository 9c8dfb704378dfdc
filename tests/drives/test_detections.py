# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Somebody else's detections in place of the clusters: a simulated drive's truth in each format."""

import json
import math
import shutil
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tests.drives.detector_files import (
    TRACKED,
    UNTRACKED,
    kitti_objects,
    kitti_tracking,
    mmdetection3d,
    openpcdet,
    our_nuscenes,
    table,
)
from tests.refusal import refused
from tests.stopping import Killed

import wildshape
from wildshape.drives import pipeline
from wildshape.drives.config import DetectionConfig, DriveConfig, GroundConfig
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.tracking.box_cutter import BoxCutter, check_cut, points_in_boxes
from wildshape.drives.tracking.detections import DetectionFile, find_detections, given_tracks
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import find_mounting
from wildshape.drives.tracking.segmentation import read_cut, read_cuts
from wildshape.drives.tracking.sightings import read_sightings
from wildshape.io.boxes.detector import upright_box
from wildshape.io.boxes.table import read_box_table
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")

SCANS, FULL = 6, 100


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """A drive of six scans on disk, and whose each of its points is."""
    root = tmp_path_factory.mktemp("detections") / "street"
    simulated = WholeDrive(StreetConfig(scans=SCANS), 1)
    write_drive(simulated, root)
    recording = root / "velodyne" / "0000"
    shutil.copy(root / "poses" / "0000.txt", recording / "poses.txt")
    drive = open_drive(recording)
    mounting = find_mounting(drive, DriveConfig().mounting)
    scans = [simulated.scan(frame) for frame in range(SCANS)]
    return SimpleNamespace(
        root=root,
        recording=recording,
        drive=drive,
        mounting=mounting,
        scans=scans,
        known=[{row.tobytes(): place for place, row in enumerate(scan.points)} for scan in scans],
        standing=[standing(scan, mounting) for scan in scans],
    )


def standing(scan, mounting):
    """Owners of the points above the ground, and how many each has."""
    heights = height_above_ground(mounting.level(scan.points), mounting.height_m, GroundConfig())
    return Counter(scan.owner[np.nan_to_num(heights) > 0.1].tolist())


def cut(street, detections, folder):
    cutter = BoxCutter(street.drive, street.mounting, folder, DriveConfig(), detections)
    for frame in cutter.missing():
        cutter(frame)
    assert cutter.missing() == []
    return list(read_cuts(folder, SCANS))


def owners(street, frame, points):
    """Whose each point of a cluster is."""
    places = [street.known[frame][row.tobytes()] for row in points]
    return street.scans[frame].owner[places]


def owner_of(street, frame, points):
    """Whose a cluster is; it must be all of a vehicle that stands above the ground, hardly more."""
    found = owners(street, frame, points)
    owner = int(np.bincount(found + 1).argmax()) - 1
    assert (found == owner).mean() > 0.95
    assert (found == owner).sum() > 0.98 * street.standing[frame][owner]
    return owner


def full_vehicles(street, frame):
    """Those of many points above the ground."""
    vehicles = {box.track for box in street.scans[frame].boxes if box.kind != "Pedestrian"}
    return {track for track in vehicles if street.standing[frame][track] >= FULL}


@pytest.mark.parametrize("write", [*TRACKED, *UNTRACKED])
def test_each_cluster_is_the_points_of_one_true_vehicle(street, write, tmp_path):
    (tmp_path / "given").mkdir()
    detections = find_detections(write(street, tmp_path / "given"), street.drive)
    assert detections.tracked == (write in TRACKED)
    cuts = cut(street, detections, tmp_path / "cuts")
    check_cut(detections, cuts)
    for frame, found in enumerate(cuts):
        assert found.scanned == len(street.scans[frame].points)
        parts = np.split(found.points, found.ends[:-1])
        whose = [owner_of(street, frame, part) for part in parts if len(part) >= FULL]
        assert len(set(whose)) == len(whose)
        assert full_vehicles(street, frame) <= set(whose)


@pytest.mark.parametrize("write", [table, our_nuscenes])
def test_boxes_of_a_drive_lie_on_corrected_scans_and_others_on_measured_ones(
    street, write, tmp_path
):
    """Those of boxes.csv were laid on scans as measured: of a fast sensor, beside the vehicles."""
    detections = find_detections(write(street, tmp_path), street.drive)
    cutter = BoxCutter(street.drive, street.mounting, tmp_path, DriveConfig(), detections)
    scan = street.scans[0].points
    heights = height_above_ground(
        street.mounting.level(scan), street.mounting.height_m, GroundConfig()
    )
    beside = scan + np.array([1.5, 0, 0], np.float32)
    expected = cutter.cut(0, scan, heights, scan).rows
    corrected, measured = (scan, beside) if write is table else (beside, scan)
    assert np.array_equal(cutter.cut(0, corrected, heights, measured).rows, expected)


@pytest.mark.parametrize("write", [kitti_objects, our_nuscenes, openpcdet, mmdetection3d])
def test_scores_leave_out_what_the_detector_doubts(street, write, tmp_path):
    given = replace(write(street, tmp_path), least_score=0.45)  # of our writer's 0.5
    every = find_detections(given, street.drive)
    assert {box.score for row in every.frames for box in row} <= {0.5, 0.7, 0.9}
    refused(
        find_detections,
        replace(given, least_score=0.95),
        street.drive,
        match=r"vehicle that scores 0\.95",
    )


def test_two_names_of_one_scan_are_told(street, tmp_path):
    given = openpcdet(street, tmp_path)
    assert not any("all taken" in told for told in find_detections(given, street.drive).warnings)
    said = json.loads(given.path.read_text())
    given.path.write_text(json.dumps([*said, {**said[0], "frame_id": "0"}]))
    (told,) = (one for one in find_detections(given, street.drive).warnings if "all taken" in one)
    assert told.startswith("boxes of '0' and of 'samples/LIDAR_TOP/")
    assert told.endswith(f"of scan {street.drive.scan_names[0]}")


def test_scores_that_no_box_has_are_not_asked_for(street, tmp_path):
    given = replace(kitti_tracking(street, tmp_path), least_score=0.3)
    refused(find_detections, given, street.drive, match="no box has a score")


def test_a_lower_score_is_counted_and_a_needless_calibration_named(street, tmp_path):
    given = openpcdet(street, tmp_path)
    said = json.loads(given.path.read_text())
    said[0]["score"][:2] = 0.1, None
    given.path.write_text(json.dumps(said))
    calibration = street.root / "calib" / "0000.txt"
    told = replace(given, least_score=0.3, calibration=calibration)
    found = find_detections(told, street.drive)
    assert None in {box.score for box in found.frames[0]}  # that without a score stays
    assert found.warnings[:2] == (
        "0000.txt is not used: only KITTI's boxes need it",
        "1 detections score less than 0.3 and are left out",
    )


def test_given_tracks_are_kept(street, tmp_path):
    detections = find_detections(table(street, tmp_path), street.drive)
    cuts = cut(street, detections, tmp_path / "cuts")
    objects = given_tracks(cuts)
    truth = {row.track for row in read_box_table(street.root / "truth" / "0000.csv")}
    assert {one.name for one in objects} <= truth
    for one in objects:
        for frame, (row,), count in zip(one.frames, one.rows, one.points, strict=True):
            points = cuts[frame].cluster(row)
            assert len(points) == count
            assert count < FULL or owner_of(street, frame, points) == int(one.name)
    full = {str(track) for frame in range(SCANS) for track in full_vehicles(street, frame)}
    assert full <= {one.name for one in objects}


def stopped_after_tracks(street, out, detections, monkeypatch):
    """The objects of a drive that is killed before the network sees one."""

    def killed(*_, **__):
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(pipeline, "Completer", killed)
        with pytest.raises(Killed):
            wildshape.drive(street.recording, out, detections=detections)
    return read_sightings(out / "stages" / "tracks.json")


def test_one_box_without_a_track_is_said_for_no_track_is_used_then(street, tmp_path):
    given = kitti_tracking(street, tmp_path)
    lines = given.path.read_text().splitlines()
    at = next(n for n, line in enumerate(lines) if " Car " in line)
    lines[at] = " ".join((lines[at].split()[0], "-1", *lines[at].split()[2:]))
    path = tmp_path / "labels.txt"
    path.write_text("\n".join(lines))
    found = find_detections(replace(given, path=path), street.drive)
    placed = sum(map(len, found.frames))
    assert not found.tracked
    assert f"1 of {placed} detections have no track: tracks are found anew" in found.warnings


def test_boxes_without_tracks_are_linked_to_those_of_the_truth(street, tmp_path, monkeypatch):
    objects = stopped_after_tracks(
        street, tmp_path / "out", openpcdet(street, tmp_path), monkeypatch
    )
    whose = []
    for one in objects:
        if min(one.points) < FULL:
            continue
        clouds = one.clouds(tmp_path / "out" / "stages" / "clusters")
        (owner,) = {owner_of(street, *seen) for seen in zip(one.frames, clouds, strict=True)}
        assert one.frames == tuple(range(one.frames[0], one.frames[-1] + 1))
        whose.append(owner)
    assert len(set(whose)) == len(whose)
    throughout = set.intersection(*(full_vehicles(street, frame) for frame in range(SCANS)))
    assert len(throughout) > 5
    assert throughout <= set(whose)


def test_another_file_does_not_go_on_with_an_output(street, tmp_path, monkeypatch):
    path = shutil.copy(street.root / "truth" / "0000.csv", tmp_path / "boxes.csv")
    given, out = DetectionFile(path), tmp_path / "out"
    stopped_after_tracks(street, out, given, monkeypatch)
    clusters = out / "stages" / "clusters" / "000003.npz"
    written = clusters.stat().st_mtime_ns
    stopped_after_tracks(street, out, given, monkeypatch)
    assert clusters.stat().st_mtime_ns == written
    refused(wildshape.drive, street.recording, out, match="--overwrite")
    path.write_text("\n".join(path.read_text().splitlines()[:-1]) + "\n")
    refused(wildshape.drive, street.recording, out, match="--overwrite", detections=given)


def test_the_network_completes_what_was_given(street, tmp_path):
    """Of a few near vehicles, to be quick."""
    rows = read_box_table(street.root / "truth" / "0000.csv")
    everywhere = Counter(row.track for row in rows if row.points > 400)
    chosen = [track for track, count in everywhere.items() if count == SCANS][:2]
    assert len(chosen) == 2
    lines = (street.root / "truth" / "0000.csv").read_text().splitlines()
    kept = [line for line in lines if line.split(",")[2] in ("track", *chosen)]
    (tmp_path / "boxes.csv").write_text("\n".join(kept) + "\n")
    given = DetectionFile(tmp_path / "boxes.csv")
    found = wildshape.drive(street.recording, tmp_path / "out", detections=given)
    assert found.candidates == 2
    assert set(found.vehicles) == set(chosen)
    track = json.loads((found.out / "tracks" / chosen[0] / "track.json").read_text())
    assert "by the boxes of boxes.csv" in json.dumps(track)
    truth = {(row.frame, row.track): row for row in rows}
    for row in read_box_table(found.out / "boxes.csv"):
        true = truth[row.frame, row.track]
        assert math.hypot(row.x - true.x, row.y - true.y) < 0.6


def test_what_is_no_vehicle_is_left_out_and_counted(street, tmp_path):
    detections = find_detections(kitti_tracking(street, tmp_path), street.drive)
    people = sum(box.kind == "Pedestrian" for scan in street.scans for box in scan.boxes)
    assert detections.warnings == (
        f"detections that are no vehicles are left out: {people} Pedestrian",
    )
    kinds = {box.category for row in detections.frames for box in row}
    assert kinds == {"Car", "Van", "Truck"}
    kept = sum(map(len, detections.frames))
    assert kept == sum(len(scan.boxes) for scan in street.scans) - people


@pytest.mark.parametrize(
    ("kind", "vehicle"),
    [
        ("Car", True),
        ("vehicle.bus.rigid", True),
        ("vehicle.bicycle", False),
        ("human.pedestrian.adult", False),
        ("REGULAR_VEHICLE", True),
        ("Cyclist", False),
        ("motorcycle", False),
        ("movable_object.pushable_pullable", False),
        ("construction_vehicle", True),
    ],
)
def test_vehicles_are_told_by_name(kind, vehicle, street, tmp_path):
    one = {"frame_id": "000000", "boxes_lidar": [[9, 0, 0, 4, 2, 1, 0]], "name": [kind]}
    (tmp_path / "one.json").write_text(json.dumps([one]))
    given = DetectionFile(tmp_path / "one.json")
    if vehicle:
        assert len(find_detections(given, street.drive).frames[0]) == 1
    else:
        refused(find_detections, given, street.drive, match=f"no box of a vehicle among 1 {kind}")


def test_points_around_a_box_are_its_own_unless_they_are_in_another():
    size = (4.0, 2.0, 2.0)
    boxes = [upright_box((0.0, 0.0, 0.0), size, 0.0), upright_box((0.0, 2.1, 0.0), size, math.pi)]
    points = np.array(
        [(0, 0, 0), (0, 0.9, 0), (0, 1.05, 0), (0, 1.15, 0), (2.1, 0, 0), (2.3, 0, 0)]
    )
    found = points_in_boxes(points.astype(np.float32), boxes, DetectionConfig(around_m=0.2))
    assert found[0].tolist() == [True, True, True, False, True, False]
    assert found[1].tolist() == [False, False, True, True, False, False]
    assert points_in_boxes(points, [], DetectionConfig()).shape == (0, 6)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("named", ["{}", "scan_{:04d}"])
def test_boxes_numbered_from_one_more_or_less_are_said_to_be(street, tmp_path, first, named):
    """Names that are no numbers are counted from 0, whatever they end in."""
    counted = 0 if named.startswith("scan") else first
    drive = replace(street.drive, scan_names=tuple(named.format(first + i) for i in range(SCANS)))
    car = {"boxes_lidar": [[9.0, 0, 0, 4, 2, 1, 0]], "name": ["Car"]}
    for start in {0, 1}:
        scans = [{**car, "frame_id": start + i} for i in range(SCANS)]
        (tmp_path / "boxes.json").write_text(json.dumps(scans))
        told = find_detections(DetectionFile(tmp_path / "boxes.json"), drive).warnings
        if start == counted:
            assert told == ()
        else:
            assert told[0].endswith(f"numbered from {start}, number them from {counted}")


def test_boxes_of_other_scans_or_in_another_frame_are_refused(street, tmp_path):
    one = {"frame_id": "000000", "boxes_lidar": [[900.0, 0, 0, 4, 2, 1, 0]], "name": ["Car"]}
    path = tmp_path / "one.json"
    path.write_text(json.dumps([one, {**one, "frame_id": "000077"}]))
    detections = find_detections(DetectionFile(path), street.drive)
    assert detections.warnings == ("1 detections belong to scans that the drive does not have",)
    cuts = cut(street, detections, tmp_path / "cuts")
    refused(check_cut, detections, cuts, match="one.json: no box holds .* own sensor frame")
    assert read_cut(tmp_path / "cuts", 0).points.shape == (0, 3)
    path.write_text(json.dumps([{**one, "frame_id": "monday"}]))
    refused(
        find_detections, DetectionFile(path), street.drive, match="'monday', are none of .*0000's"
    )


@pytest.mark.parametrize(
    ("frame_deg", "heading_deg", "told"),
    [(0, 0, ""), (0, 90, "if each is turned by 90 degrees"), (90, 90, "beside the vehicles")],
)
def test_boxes_that_do_not_lie_on_the_vehicles_are_said(
    street, tmp_path, frame_deg, heading_deg, told
):
    """With wrong headings a third of the vehicles were found, askew, and nothing was said."""
    given = openpcdet(street, tmp_path)
    scans = json.loads(given.path.read_text())
    c, s = math.cos(math.radians(frame_deg)), math.sin(math.radians(frame_deg))
    for scan in scans:
        for row in scan["boxes_lidar"]:
            x, y = row[:2]
            row[:2] = c * x - s * y, s * x + c * y
            row[6] += math.radians(heading_deg)
    given.path.write_text(json.dumps(scans))
    said = [one for one in find_detections(given, street.drive).warnings if "boxes hold" in one]
    assert len(said) == bool(told)
    assert told in "".join(said)


def test_a_track_has_one_box_a_frame(street, tmp_path):
    lines = (street.root / "truth" / "0000.csv").read_text().splitlines()
    path = tmp_path / "boxes.csv"
    path.write_text("\n".join([*lines, lines[1]]) + "\n")
    refused(find_detections, DetectionFile(path), street.drive, match="2 boxes of track .* frame 0")
    path.write_text("\n".join([lines[0], lines[1].replace(",6,", ",../6,", 1)]) + "\n")
    refused(
        find_detections, DetectionFile(path), street.drive, match=r"boxes\.csv: .*become a file"
    )
