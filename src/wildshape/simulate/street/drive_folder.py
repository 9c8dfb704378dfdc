# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated drive on disk, in KITTI tracking's own layout, scan by scan.

velodyne/0000/000000.bin   x y z intensity, float32; times.txt beside them: seconds, a line each
label_02/0000.txt          everybody in each scan, vehicles and pedestrians
calib/0000.txt             LiDAR, camera and GPS/IMU: a camera that nobody looked through
oxts/0000.txt              GPS/IMU records without errors
poses/0000.txt             T_world_sensor, 12 numbers a line
truth/0000.csv             the vehicles as `wildshape drive` writes boxes, sensor frame
scans/0000/000000.ply      if asked for: x y z intensity time, seconds from the scan's middle
"""

import json
import math
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.io.atomic import atomic_write, write_json, write_text
from wildshape.io.boxes.kitti import label_line
from wildshape.io.boxes.table import HEADER
from wildshape.records import Box
from wildshape.simulate.street.whole_drive import DriveScan, TrueBox, WholeDrive

SEQUENCE = "0000"
FILES = (
    "velodyne/*/*",
    "scans/*/*",
    "label_02/*",
    "calib/*",
    "oxts/*",
    "poses/*",
    "truth/*",
    ".rows/*",
)
_ROWS = ".rows"
_EARTH_M, _LATITUDE, _LONGITUDE = 6378137.0, 49.0, 8.4
_UNREAD = 24  # of the 30 numbers of a GPS/IMU record
# As in KITTI: the camera ahead of and below the LiDAR, the GPS/IMU behind it.
_T_RECT_VELO = np.array(((0, -1, 0, 0), (0, 0, -1, -0.08), (1, 0, 0, -0.27), (0, 0, 0, 1.0)))
_T_VELO_IMU = np.array(((1, 0, 0, -0.81), (0, 1, 0, 0.32), (0, 0, 1, -0.8), (0, 0, 0, 1.0)))
_PROJECTION = np.array(((721.5377, 0, 609.5593, 0), (0, 721.5377, 172.854, 0), (0, 0, 1, 0.0)))


@dataclass
class Written:
    """How much lies there."""

    scans: int = 0
    points: int = 0
    vehicles: int = 0


def write_drive(
    drive: WholeDrive,
    out: Path,
    at: Callable[[int], None] = lambda _: None,
    *,
    point_times: bool = False,
) -> Written:
    """Write all scans and then their truth; scans that are there already are not made again.

    What an interrupted run of the same drive left is gone on with. `at` is told how many scans are
    there; `point_times`: write `scans`, too.
    """
    scans, rows = out / "velodyne" / SEQUENCE, out / _ROWS
    for number in range(drive.config.scans):
        name = f"{number:06d}"
        if not (scans / f"{name}.bin").is_file():
            made = drive.scan(number)
            write_json(rows / f"{name}.json", _rows(made, number, drive))
            if point_times:
                _write_timed(out / "scans" / SEQUENCE / f"{name}.ply", made)
            _write_bin(scans / f"{name}.bin", made)
        at(number + 1)
    if not _truth_file(out).is_file():
        _join(out, rows, drive.config.scans)
    shutil.rmtree(rows, ignore_errors=True)
    if point_times:
        times = (scans / "times.txt").read_text("utf-8")
        write_text(out / "scans" / SEQUENCE / "times.txt", times)
    return _counted(out)


def _truth_file(out: Path) -> Path:
    """What is written last."""
    return out / "truth" / f"{SEQUENCE}.csv"


def _counted(out: Path) -> Written:
    scans = list((out / "velodyne" / SEQUENCE).glob("*.bin"))
    with _truth_file(out).open(encoding="utf-8") as lines:
        vehicles = {line.split(",")[2] for line in islice(lines, 1, None)}
    points = sum(scan.stat().st_size for scan in scans) // 16
    return Written(len(scans), points, len(vehicles))


def _write_bin(path: Path, made: DriveScan) -> None:
    columns = np.column_stack((made.points, made.intensity))
    with atomic_write(path) as file:
        file.write(columns.astype("<f4").tobytes())


def _write_timed(path: Path, made: DriveScan) -> None:
    columns = np.column_stack((made.points, made.intensity, made.times))
    fields = "".join(f"property float {name}\n" for name in ("x", "y", "z", "intensity", "time"))
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(columns)}\n{fields}"
    with atomic_write(path) as file:
        file.write(f"{head}end_header\n".encode())
        file.write(columns.astype("<f4").tobytes())


def _rows(made: DriveScan, number: int, drive: WholeDrive) -> dict[str, list[str]]:
    """One scan's lines of the files of the whole drive."""
    vehicles = [box for box in made.boxes if box.kind != "Pedestrian"]
    start = drive.sensor_pose(np.zeros(1))[0] @ _T_VELO_IMU
    return {
        "times": [f"{made.time:.6f}"],
        "label_02": [_label(box, number) for box in made.boxes],
        "oxts": [_oxts(made.T_world_sensor @ _T_VELO_IMU, start)],
        "poses": [_numbers(made.T_world_sensor[:3].ravel())],
        "truth": [_truth(box, number, made.time) for box in vehicles],
    }


def _join(out: Path, rows: Path, scans: int) -> None:
    """The files of the whole drive, from its scans' lines, one scan at a time."""

    def each() -> Iterator[dict[str, list[str]]]:
        for number in range(scans):
            yield json.loads((rows / f"{number:06d}.json").read_text("utf-8"))

    write_text(out / "calib" / f"{SEQUENCE}.txt", _calibration())
    files = {
        "label_02": out / "label_02" / f"{SEQUENCE}.txt",
        "oxts": out / "oxts" / f"{SEQUENCE}.txt",
        "poses": out / "poses" / f"{SEQUENCE}.txt",
        "times": out / "velodyne" / SEQUENCE / "times.txt",
        "truth": _truth_file(out),
    }
    for name, path in files.items():
        with atomic_write(path) as file:
            if name == "truth":
                file.write(f"{','.join(HEADER)}\n".encode())
            for row in each():
                file.write("".join(f"{line}\n" for line in row[name]).encode())


def _label(box: TrueBox, frame: int) -> str:
    T = _T_RECT_VELO @ box.T_sensor_object
    wxyz = quaternion_from_rotation(torch.from_numpy(T[:3, :3].copy())).tolist()
    (x, y, z), (qw, qx, qy, qz) = T[:3, 3].tolist(), wxyz
    seen = Box((x, y, z), box.size, (qw, qx, qy, qz))
    return label_line(frame, box.track, box.kind, seen, _PROJECTION)


def _truth(box: TrueBox, frame: int, time: float) -> str:
    T = box.T_sensor_object
    yaw = math.atan2(T[1, 0], T[0, 0])
    place = ",".join(f"{number:.6f}" for number in (*T[:3, 3], *box.size, yaw))
    return f"{frame},{time:.6f},{box.track},{place},1,{box.points},{int(box.moving)}"


def _oxts(T_world_imu: np.ndarray, start: np.ndarray) -> str:
    """KITTI's record: place on the Mercator map, turns; the rest is left at 0."""
    east, north, up = T_world_imu[:3, 3] - start[:3, 3]
    scale = math.cos(math.radians(_LATITUDE)) * _EARTH_M
    mercator = math.log(math.tan(math.radians(90 + _LATITUDE) / 2)) + north / scale
    latitude = math.degrees(2 * math.atan(math.exp(mercator))) - 90
    R = T_world_imu[:3, :3]
    turns = math.atan2(R[2, 1], R[2, 2]), math.asin(-R[2, 0]), math.atan2(R[1, 0], R[0, 0])
    longitude = _LONGITUDE + math.degrees(east / scale)
    return _numbers((latitude, longitude, up + 100.0, *turns, *[0.0] * _UNREAD))


def _calibration() -> str:
    matrices = {
        **{f"P{i}:": _PROJECTION for i in range(4)},
        "R_rect": np.eye(3),
        "Tr_velo_cam": _T_RECT_VELO[:3],
        "Tr_imu_velo": _T_VELO_IMU[:3],
    }
    return "".join(f"{name} {_numbers(matrix.ravel())}\n" for name, matrix in matrices.items())


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{float(value):.14g}" for value in values)
