# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of what `drive` takes: bags, folders and data sets' drives, boxes of other detectors."""

import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import torch
from tests.datasets import write_argoverse2 as av2
from tests.datasets import write_kitti_tracking as tracking
from tests.datasets import write_nuscenes as nuscenes
from tests.datasets import write_pandaset as pandaset
from tests.datasets import write_waymo as waymo
from tests.datasets.street import street
from tests.drives import detector_files
from tests.fuzz.scans import CLOUD
from tests.fuzz.target import Arrays, Target, only_file
from tests.io.bags.write import write_bag
from tests.io.packets import write as packets

from wildshape.drives.config import DriveConfig
from wildshape.drives.recordings import waymo as waymo_drives
from wildshape.drives.recordings.recording_kinds import find_drives, open_drive
from wildshape.drives.source import Drive
from wildshape.drives.tracking.box_cutter import cut_boxes
from wildshape.drives.tracking.detections import DetectionFile, find_detections, given_tracks
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.writing.files import DriveFiles, detections_of
from wildshape.drives.writing.finished import read_finished
from wildshape.evaluation.drives.labels import Counting, read_labels
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.box_files import BOX_FORMATS, BoxFiles
from wildshape.io.boxes.table import BoxRow, write_box_table
from wildshape.io.poses import write_poses, write_tum
from wildshape.io.scans.writers import write_ply
from wildshape.records import Turn

_FRAMES = 2
_LEVEL = Mounting(1.7, 0.0, (0.0, 0.0, 1.0))


def _read(drive: Drive) -> Arrays:
    """All that a recording gives."""
    yield np.array(drive.ticks, float)
    yield np.array(drive.times or (), float)
    if drive.T_world_sensor is not None:
        yield drive.T_world_sensor.matrix.numpy()
        drive = drive.moved_by(drive.T_world_sensor)
    for frame in range(len(drive)):
        turn = drive.turn(frame)
        yield turn.points
        yield turn.seconds
        yield drive.scan(frame)


def _build_bags(folder: Path) -> None:
    scans = {"/points": [CLOUD, CLOUD[:20]]}
    for kind in ("db3", "mcap", "bag"):
        for packed in (False, True):
            place = folder / f"{kind}{'-packed' * packed}"
            place.parent.mkdir(parents=True, exist_ok=True)
            if kind == "bag":
                place.mkdir()
                place /= "drive"
            write_bag(place, kind, scans, packed=packed, extra=("/text",))


def _is_recorded(name: str) -> bool:
    return name.endswith((".db3", ".mcap", ".bag"))


def _read_bags(folder: Path) -> Arrays:
    file = next(folder.glob("*.bag"), None)
    yield from _read(open_drive(file or folder))


def _build_packets(folder: Path) -> None:
    """Two turns of a VLP-16, alone and beside a sensor whose packets end as an HDL-64E's."""
    rng = np.random.default_rng(0)
    scans = rng.integers(0, 9000, (2, packets.PACKETS, packets.BLOCKS, packets.LASERS))
    ranges = scans.astype(np.uint16)
    for name, others in (("alone.pcap", ()), ("alone.pcapng", ()), ("two.pcap", ranges[:1])):
        place = folder / name.replace(".", "-")
        place.mkdir(parents=True)
        packets.write_velodyne(place / name, ranges, others=others, hdl64e=True)


def _read_packets(folder: Path) -> Arrays:
    yield from _read(open_drive(only_file(folder)))


def _build_recordings(folder: Path) -> None:
    """Folders of scans with what may lie beside them, and drives of data sets."""
    scene = street(frames=_FRAMES, points=40)
    for name, scans, times in (
        ("plain", "", "times.txt"),
        ("odometry", "velodyne", "times.txt"),
        ("raw", "velodyne_points/data", "velodyne_points/timestamps.txt"),
    ):
        place = folder / name / scans
        place.mkdir(parents=True)
        for frame in range(_FRAMES):
            np.pad(CLOUD, ((0, 0), (0, 1))).tofile(place / f"{frame:06d}.bin")
        seconds = ("2011-09-26 13:02:25.594360375", "2011-09-26 13:02:25.697710895")
        text = "\n".join(seconds) if name == "raw" else "0.0\n1.036224e-01"
        (folder / name / times).write_text(f"{text}\n")
    write_poses(folder / "plain" / "poses.txt", SE3.identity(_FRAMES))
    av2.write_log(folder / "argoverse2" / av2.LOG, scene)
    pandaset.write_scene(folder / "pandaset" / "001", scene)
    thing = nuscenes.Thing("car", keys=(0, 1))
    nuscenes.write_nuscenes(folder / "nuscenes", [nuscenes.Scene(things=(thing,), keys=2)], count=9)
    car = waymo.Thing("Kw3hbYbGR0iVbsqyFoD9uQ", frames=(0, 1))
    waymo.write_waymo(folder / "waymo" / "training", [car], frames=_FRAMES, shape=(10, 180))


def _read_recordings(folder: Path) -> Arrays:
    """The cache of nuScenes' tables is its own for each input, that of Waymo's is emptied."""
    waymo_drives._reader.cache_clear()
    with (
        tempfile.TemporaryDirectory(dir=folder.parent.parent) as cache,
        mock.patch.dict(os.environ, {"XDG_CACHE_HOME": cache}),
    ):
        for path in find_drives(folder).drives:
            yield from _read(open_drive(path))


def _labelled(root: Path) -> Any:
    """Two frames with true boxes, as `detector_files` takes a simulated drive."""
    scene = street(_FRAMES, points=60, eye=tracking.EYE)
    tracking.write_sequence(root, scene, "0000")
    labels = read_labels(root, Counting(points=0, range_m=1e6))
    rows, scans = [], []
    for frame, found in enumerate(labels.frames):
        boxes = []
        for one in found.labels:
            x, y, z, *size, yaw = one.box
            T = np.eye(4)
            T[:2, :2] = (np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))
            T[:3, 3] = x, y, z
            true = {"track": one.track, "kind": "Car", "size": tuple(size), "T_sensor_object": T}
            boxes.append(SimpleNamespace(**true))
            row = BoxRow(frame, None, f"{one.track}", *one.box, 0.9, 50, moving=False)
            rows.append(row)
        scans.append(SimpleNamespace(boxes=boxes))
    write_box_table(root / "truth" / "0000.csv", rows)
    names = tuple(f"{frame:06d}" for frame in range(_FRAMES))
    return SimpleNamespace(root=root, scans=scans, drive=SimpleNamespace(scan_names=names))


def _build_detections(folder: Path) -> None:
    """A folder with boxes, and a calibration beside it, for each format of other detectors."""
    with tempfile.TemporaryDirectory() as root:
        labelled = _labelled(Path(root))
        writers: tuple[Callable[[Any, Path], DetectionFile], ...] = (
            *detector_files.TRACKED,
            *detector_files.UNTRACKED,
        )
        for write in writers:
            boxes = folder / write.__name__ / "boxes"
            boxes.mkdir(parents=True)
            given = write(labelled, boxes)
            if given.path.is_file():
                (boxes / given.path.name).write_bytes(given.path.read_bytes())
            if given.calibration is not None:
                (boxes.parent / "calib.txt").write_bytes(given.calibration.read_bytes())


def _read_detections(folder: Path) -> Arrays:
    boxes, calibration = folder / "boxes", folder / "calib.txt"
    files = list(boxes.iterdir())
    file = DetectionFile(
        only_file(boxes) if len(files) == 1 else boxes,
        calibration if calibration.is_file() else None,
    )
    file.identity()
    drive = Drive.of("street", [f"{i:06d}" for i in range(_FRAMES)], lambda _: Turn(CLOUD))
    found = find_detections(file, drive)
    config = DriveConfig()
    heights = height_above_ground(CLOUD, _LEVEL.height_m, config.ground)
    cuts = [
        cut_boxes(CLOUD, row, heights, config, CLOUD, tracked=found.tracked) for row in found.frames
    ]
    for row, cut in zip(found.frames, cuts):
        yield np.array([(*one.box.centre, *one.box.size) for one in row])
        yield cut.points
    if found.tracked:
        given_tracks(cuts)


def _build_finished(folder: Path) -> None:
    out = folder / "finished"
    rows = [
        BoxRow(i, 0.1 * i, name, 9.0, y, -1.0, 4.2, 1.8, 1.5, 0.1, 0.9, 24, moving=y > 0)
        for i in range(_FRAMES)
        for name, y in (("000", 3.0), ("001", -3.0))
    ]
    write_box_table(out / "boxes.csv", rows)
    (out / "frames.csv").write_text("frame,scan,time,points\n0,000000,0,24\n1,000001,0.1,24\n")
    write_poses(out / "trajectory.txt", SE3.identity(_FRAMES))
    write_tum(out / "trajectory.tum", SE3.identity(_FRAMES), (0.0, 0.1))
    for name in ("000", "001"):
        write_ply(out / "shapes" / f"{name}.ply", CLOUD)
    (out / "stages").mkdir()
    mounting = {"height_m": 1.7, "tilt_deg": 0.6, "up": [0.0, 0.01, 0.99995]}
    (out / "stages" / "mounting.json").write_text(json.dumps(mounting))
    turns = {"sense": 1, "ticks": list(range(_FRAMES))}
    (out / "stages" / "turns.json").write_text(json.dumps(turns))
    said = {"command": "drive", "settings": {"source": "street", "scans": _FRAMES}}
    (out / "wildshape.json").write_text(json.dumps(said))


def _read_finished(folder: Path) -> Arrays:
    """As other formats and pages are made of it."""
    found = read_finished(folder)
    yield torch.tensor(found.seconds).numpy()
    yield np.array(found.travelled_m)
    for one in found.vehicles:
        yield np.array([(*box.centre, *box.size) for box in one.boxes])
        yield found.velocities(one)
        yield found.shape(one)
    list(detections_of(found))
    DriveFiles(BoxFiles(BOX_FORMATS)).write(folder)


TARGETS = (
    Target("bags", _build_bags, _read_bags, 1.5, attacked=_is_recorded),
    Target("packets", _build_packets, _read_packets, 0.5),
    Target("recordings", _build_recordings, _read_recordings, 0.5),
    Target("detections", _build_detections, _read_detections, 1),
    Target("finished-drive", _build_finished, _read_finished, 0.5, writes=True),
)
