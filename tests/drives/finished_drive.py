# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a finished drive as `wildshape drive` leaves it, made without finding anything."""

import gc
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch

from wildshape.drives.writing.finished import FinishedDrive, read_finished
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.table import BoxRow, write_box_table
from wildshape.io.poses import write_poses, write_tum
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import write_track
from wildshape.records import Track

FRAMES, HEIGHT, SIZE = 6, 1.7, (4.4, 1.8, 1.5)
# Middles in the world: one that stands, and one that comes towards the sensor at 8 m/s.
CARS = {
    "0003": [(12.0, 3.5, 0.2)] * FRAMES,
    "<7>": [(30.0 - 0.8 * frame, -2.0, 3.0) for frame in range(FRAMES)],
}


def finished_drive(
    folder: Path, cars: Mapping[str, list[tuple[float, float, float]]] = CARS
) -> FinishedDrive:
    """The sensor drives 1 m a frame along x, past two cars on a plane."""
    rng = np.random.default_rng(0)
    out, recording = folder / "found", folder / "street"
    times = [0.1 * frame for frame in range(FRAMES)]
    names = [f"{frame:06d}" for frame in range(FRAMES)]
    shape = _shell(rng, 800)
    rows, seen = [], {name: [] for name in cars}
    recording.mkdir(parents=True)
    for frame in range(FRAMES):
        ground = np.column_stack((rng.uniform(-40, 40, (3000, 2)), np.full(3000, -HEIGHT)))
        parts = [ground]
        for name, places in cars.items():
            x, y, yaw = places[frame]
            T_sensor_box = _pose(x - frame, y, SIZE[2] / 2 - HEIGHT, yaw)
            points = T_sensor_box.apply_numpy(_shell(rng, 200))
            seen[name].append((points, T_sensor_box))
            parts.append(points)
            at, left, up = T_sensor_box.translation.tolist()
            moving = name == "<7>"
            rows.append(
                BoxRow(
                    frame,
                    times[frame],
                    name,
                    at,
                    left,
                    up,
                    *SIZE,
                    yaw=yaw,
                    confidence=0.9,
                    points=200,
                    moving=moving,
                )
            )
        np.save(recording / f"{names[frame]}.npy", np.concatenate(parts).astype(np.float32))
    (recording / "times.txt").write_text("".join(f"{time}\n" for time in times))
    for name, scans in seen.items():
        _write_object(out, name, names, scans, shape)
    write_box_table(out / "boxes.csv", rows)
    way = torch.zeros(FRAMES, 3, dtype=torch.float64)
    way[:, 0] = torch.arange(FRAMES)
    T_world_sensor = SE3(torch.eye(3, dtype=torch.float64).repeat(FRAMES, 1, 1), way)
    write_poses(out / "trajectory.txt", T_world_sensor)
    write_tum(out / "trajectory.tum", T_world_sensor, times)
    lines = [f"{i},{name},{time},3400\n" for i, (name, time) in enumerate(zip(names, times))]
    (out / "frames.csv").write_text("frame,scan,time,points\n" + "".join(lines))
    (out / "stages").mkdir()
    mounting = {"height_m": HEIGHT, "tilt_deg": 0.0, "up": [0.0, 0.0, 1.0]}
    (out / "stages" / "mounting.json").write_text(json.dumps(mounting))
    result = {"seconds": {"trajectory": 1.5, "completion": 2.5}, "warnings": ["a strange thing"]}
    said = {"command": "drive", "status": "finished", "settings": {"source": str(recording)}}
    (out / "wildshape.json").write_text(json.dumps({**said, "result": result}))
    return read_finished(out)


def poses_alive() -> int:
    """Poses that are held now: one for each box of a long drive would take gigabytes."""
    gc.collect()
    return sum(type(one) is SE3 for one in gc.get_objects())


def _write_object(out: Path, name: str, names: list[str], scans: list, shape: np.ndarray) -> None:
    write_ply(out / "shapes" / f"{name}.ply", shape)
    clouds = tuple(points for points, _ in scans)
    write_track(out / "tracks" / name, Track(name, clouds, tuple(names), category="car"))
    kept = (1, 3)  # completed
    folder = out / "objects" / name
    entries = []
    for frame in kept:
        T = scans[frame][1]
        write_ply(folder / "completed" / f"{names[frame]}.ply", T.apply_numpy(shape))
        yaw = float(torch.atan2(T.rotation[1, 0], T.rotation[0, 0]))
        wxyz = [float(np.cos(yaw / 2)), 0.0, 0.0, float(np.sin(yaw / 2))]
        box = {"centre": T.translation.tolist(), "size": SIZE, "quaternion_wxyz": wxyz}
        stated = {"confidence": 0.9, "p_pose": 0.97, "p_box": 0.94, "p_kind": 0.99}
        entries.append({"scan": names[frame], "box": box, "cost_m": 0.05, **stated})
    poses = torch.stack([scans[frame][1].matrix for frame in kept])
    write_poses(folder / "poses.txt", SE3.from_matrix(poses))
    said = {"track": name, "sensor": "lidar", "category": "car", "scans": entries}
    (folder / "objects.json").write_text(json.dumps(said))


def _shell(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points on the sides of a box."""
    points = rng.uniform(-0.5, 0.5, (count, 3))
    side = rng.integers(0, 3, count)
    points[np.arange(count), side] = np.where(rng.random(count) < 0.5, -0.5, 0.5)
    return (points * SIZE).astype(np.float32)


def _pose(x: float, y: float, z: float, yaw: float) -> SE3:
    place = torch.tensor((x, y, z), dtype=torch.float64)
    return SE3(rotation_z(torch.tensor(yaw, dtype=torch.float64)), place)
