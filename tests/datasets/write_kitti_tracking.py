# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sequence in KITTI tracking's layout."""

import math

import numpy as np
from tests.datasets.street import SIZE, moved, rigid, street

EYE = (1.3, 0.0, 1.6)
IDS = {"parked": 3, "moving": 12}
T_EGO_VELO = rigid(*EYE, yaw=0.02, pitch=-0.015, roll=0.01)
T_EGO_IMU = rigid(0.5, 0.3, 0.9, yaw=-0.01, pitch=0.02, roll=0.005)
# Boxes turn about the camera's y alone: the rectified camera stands upright on `street`'s road,
# whose ego leans by this.
_LEAN = rigid(0, 0, 0, 0, 0.01, -0.015)
T_EGO_RECT = np.linalg.inv(_LEAN) @ rigid(1.6, 0.1, 1.4, -math.pi / 2, 0, -math.pi / 2)
T_RECT_CAMERA = rigid(0, 0, 0, 0.01, -0.008, 0.004)
_EARTH = 6378137.0
_LATITUDE, _LONGITUDE = 49.011212804408, 8.4228850417969


def write_sequence(training, scene, name="0001", oxts=False, colon=":"):
    """Write scans, labels and calibration of a `Street`; returns the training folder."""
    for folder in ("label_02", "calib", f"velodyne/{name}", "oxts" if oxts else "calib"):
        (training / folder).mkdir(parents=True, exist_ok=True)
    write_calibration(training / "calib" / f"{name}.txt", colon)
    rows = [label_row(scene, frame, thing) for frame in range(len(scene.clouds)) for thing in IDS]
    ignored = "0 -1 DontCare -1 -1 -10 505.05 167.89 564.47 197.36 -1000 -1000 -1000 -10 -1 -1 -1"
    (training / "label_02" / f"{name}.txt").write_text("\n".join([ignored, *rows]) + "\n")
    for i, T_world_ego in enumerate(scene.T_world_ego):
        points = moved(np.linalg.inv(T_world_ego @ T_EGO_VELO), scene.clouds[i])
        rows = np.pad(points, ((0, 0), (0, 1)), constant_values=0.3)
        rows.astype("<f4").tofile(training / "velodyne" / name / f"{i:06d}.bin")
    if oxts:
        lines = [oxts_row(T @ T_EGO_IMU, scene.T_world_ego[0]) for T in scene.T_world_ego]
        (training / "oxts" / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return training


def write_calibration(path, colon=":"):
    """With colons the names are the older ones of the two in use."""
    rect, velo, imu = (
        ("R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")
        if colon
        else ("R_rect", "Tr_velo_cam", "Tr_imu_velo")
    )
    T_camera_velo = np.linalg.inv(T_EGO_RECT @ T_RECT_CAMERA) @ T_EGO_VELO
    T_velo_imu = np.linalg.inv(T_EGO_VELO) @ T_EGO_IMU
    entries = {f"P{i}": np.eye(4)[:3] for i in range(4)} | {rect: T_RECT_CAMERA[:3, :3]}
    entries |= {velo: T_camera_velo[:3], imu: T_velo_imu[:3]}
    lines = [f"{n}{colon} " + " ".join(f"{v:.12e}" for v in m.ravel()) for n, m in entries.items()]
    path.write_text("\n".join(lines) + "\n")


def label_row(scene, frame, thing):
    """A line of `label_02`: the box stands on its floor's centre."""
    T = np.linalg.inv(scene.T_world_ego[frame] @ T_EGO_RECT) @ scene.T_world_object[thing][frame]
    x, y, z = T[:3, 3] + (0, SIZE[2] / 2, 0)
    turn = math.atan2(-T[2, 0], T[0, 0])
    length, width, height = SIZE
    image = "0 0 -10 0.0 0.0 100.0 100.0"
    numbers = " ".join(f"{value:.6f}" for value in (height, width, length, x, y, z, turn))
    return f"{frame} {IDS[thing]} Car {image} {numbers}"


def oxts_row(T_world_imu, T_world_start):
    """Latitude, longitude, altitude, roll, pitch, yaw, and 24 numbers that nobody reads."""
    east, north, up = T_world_imu[:3, 3] - T_world_start[:3, 3]
    R = T_world_imu[:3, :3]
    scale = math.cos(math.radians(_LATITUDE)) * _EARTH
    start = math.log(math.tan(math.radians(90 + _LATITUDE) / 2))
    latitude = math.degrees(2 * math.atan(math.exp(start + north / scale))) - 90
    longitude = _LONGITUDE + math.degrees(east / scale)
    turns = math.atan2(R[2, 1], R[2, 2]), math.asin(-R[2, 0]), math.atan2(R[1, 0], R[0, 0])
    numbers = [latitude, longitude, up + 112.8, *turns, *[0.0] * 24]
    return " ".join(f"{value:.14g}" for value in numbers)


def picture_scene(root):
    """A parked car, passed; what the documentation shows."""
    write_sequence(root / "training", street(9, points=4000, eye=EYE))
