# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sequence in SemanticKITTI's layout."""

import numpy as np
from tests.cars import off_surface
from tests.datasets.street import moved, rigid, street

EYE = (1.3, 0.0, 1.6)
T_EGO_VELO = rigid(*EYE, yaw=0.02, pitch=-0.015, roll=0.01)
# Camera x right, y down, z forward, a little turned and 27 cm ahead, as KITTI's Tr has it.
T_CAMERA_VELO = rigid(0, 0, 0, -1.58, 0.01, -1.56) @ rigid(-0.29, 0.01, 0.08)
LABELS = {"parked": 7 << 16 | 10, "moving": 7 << 16 | 252}
ROAD = 40


def velo_poses(scene):
    """`T_world_velo`, a matrix a frame."""
    return [T @ T_EGO_VELO for T in scene.T_world_ego]


def row(T, digits=6):
    return " ".join(f"{value:.{digits}e}" for value in T[:3].ravel())


def write_sequence(folder, scene, labels=None):
    """Write scans, labels and poses of a `Street`; returns the sequence's folder."""
    folder.mkdir(parents=True)
    write_calibration(folder)
    T_world_velo = velo_poses(scene)
    T_camera0_world = T_CAMERA_VELO @ np.linalg.inv(T_world_velo[0])
    poses = [T_camera0_world @ T @ np.linalg.inv(T_CAMERA_VELO) for T in T_world_velo]
    (folder / "poses.txt").write_text("".join(f"{row(T)}\n" for T in poses))
    times = [f"{0.1037 * i:.6e}\n" for i in range(len(poses))]
    (folder / "times.txt").write_text("".join(times))
    for i, T in enumerate(T_world_velo):
        in_velo = moved(np.linalg.inv(T), scene.clouds[i])
        write_frame(folder, i, in_velo, labels_of(scene, i, labels or LABELS))
    return folder


def labels_of(scene, frame, labels):
    """Label of each point: of the car on whose surface it lies, or road."""
    found = np.full(len(scene.clouds[frame]), ROAD, np.uint32)
    for name, places in scene.T_world_object.items():
        off = off_surface(moved(np.linalg.inv(places[frame]), scene.clouds[frame]))
        found[off < 1e-6] = labels[name]
    return found


def write_calibration(folder):
    camera = f"{row(np.eye(4), 12)}\n"
    lines = [f"P{i}: {camera}" for i in range(4)]
    (folder / "calib.txt").write_text("".join(lines) + f"Tr: {row(T_CAMERA_VELO, 12)}\n")


def write_frame(folder, frame, points, labels):
    """Points `(n, 3)` in the velodyne frame, labels `(n,)`."""
    for name in ("velodyne", "labels"):
        (folder / name).mkdir(exist_ok=True)
    rows = np.pad(points, ((0, 0), (0, 1)), constant_values=0.3)
    rows.astype("<f4").tofile(folder / "velodyne" / f"{frame:06d}.bin")
    np.asarray(labels).astype("<u4").tofile(folder / "labels" / f"{frame:06d}.label")


def picture_scene(root):
    """A parked car, passed; what the documentation shows."""
    write_sequence(root / "sequences" / "00", street(9, points=4000, eye=EYE))
