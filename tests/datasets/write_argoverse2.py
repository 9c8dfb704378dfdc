# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A log in the layout of Argoverse 2's sensor data set."""

import numpy as np
import pyarrow as pa
from pyarrow import feather
from scipy.spatial.transform import Rotation, Slerp
from tests.datasets.street import SIZE, moved, rigid, street, wxyz

LOG = "0aa4e8f5-2f9a-39a1-8f80-c2fdde4405a2"
UUIDS = {
    "parked": "1046f12a-152a-4e82-b61b-75468bcda8ae",
    "moving": "f696430a-b84b-4c1e-afcf-902343d36a40",
}
STAMPS = [315966253660357000 + 100_000_000 * i for i in range(100)]
T_EGO_UP = rigid(1.35018, 0.0, 1.64042, yaw=-0.0102)
T_EGO_DOWN = rigid(1.34676, 0.00457, 1.52550, yaw=-0.2, roll=3.1405)


def pose_columns(matrices):
    quaternions = np.array([wxyz(T) for T in matrices])
    columns = {f"q{axis}": quaternions[:, i] for i, axis in enumerate("wxyz")}
    return columns | {f"t{axis}_m": [T[i, 3] for T in matrices] for i, axis in enumerate("xyz")}


def write_table(path, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(columns), str(path))


def write_log(folder, scene, category="REGULAR_VEHICLE"):
    """Write all of a log but images and maps; returns its folder."""
    write_labels(folder, scene, category)
    stamps = STAMPS[: len(scene.clouds)]
    write_poses(folder, scene.T_world_ego)
    write_calibration(folder)
    for stamp, T_world_ego, cloud in zip(stamps, scene.T_world_ego, scene.clouds):
        write_sweep(folder / f"sensors/lidar/{stamp}.feather", in_ego(T_world_ego, cloud))
    return folder


def write_poses(folder, T_world_ego):
    """At the sweeps' times, and between them: the real file has the cameras' times as well."""
    times = STAMPS[: len(T_world_ego)]
    known = [T[:3, :3] for T in T_world_ego]
    turn = Slerp(times, Rotation.from_matrix(known)) if len(times) > 1 else None
    places = np.array([T[:3, 3] for T in T_world_ego])
    written = np.array([t + d for t in times for d in (-40_000_000, 0)][1:], np.int64)
    poses = []
    for time in written:
        T = np.eye(4)
        T[:3, :3] = known[0] if turn is None else turn(time).as_matrix()
        T[:3, 3] = [np.interp(time, times, places[:, i]) for i in range(3)]
        poses.append(T)
    columns = {"timestamp_ns": written} | pose_columns(poses)
    write_table(folder / "city_SE3_egovehicle.feather", columns)


def in_ego(T_world_ego, cloud):
    return moved(np.linalg.inv(T_world_ego), cloud).astype(np.float16)


def write_labels(folder, scene, category):
    boxes = [
        (stamp, UUIDS[name], np.linalg.inv(scene.T_world_ego[i]) @ places[i])
        for i, stamp in enumerate(STAMPS[: len(scene.clouds)])
        for name, places in scene.T_world_object.items()
    ]
    stamps, uuids, matrices = zip(*boxes)
    columns = {"timestamp_ns": np.array(stamps, np.int64), "track_uuid": uuids}
    columns |= {"category": [category] * len(boxes)}
    columns |= {f"{k}_m": [v] * len(boxes) for k, v in zip(("length", "width", "height"), SIZE)}
    columns |= pose_columns(matrices)
    write_table(folder / "annotations.feather", columns)


def write_calibration(folder, names=("ring_front_center", "up_lidar", "down_lidar")):
    matrices = (rigid(1.6, 0, 1.4, -1.5, 0, -1.5), T_EGO_UP, T_EGO_DOWN)
    write_table(
        folder / "calibration" / "egovehicle_SE3_sensor.feather",
        {"sensor_name": list(names)} | pose_columns(matrices[: len(names)]),
    )


def offsets_ns(points):
    """When each point was taken, since the sweep's time: the LiDARs turn once in 100 ms."""
    return np.arange(points) * 100_000_000 // max(points, 1)


def write_sweep(path, points):
    """Points `(n, 3)` float16, ego frame; every second one was taken by `up_lidar`."""
    index = np.arange(len(points))
    columns = {axis: points[:, i] for i, axis in enumerate("xyz")}
    columns |= {"intensity": np.full(len(points), 9, np.uint8)}
    columns |= {"laser_number": (index % 2 * 32 + index % 31).astype(np.uint8)}
    columns |= {"offset_ns": offsets_ns(len(points)).astype(np.int32)}
    write_table(path, columns)


def picture_scene(root):
    """A parked car, passed; what the documentation shows."""
    write_log(root / "sensor" / "val" / LOG, street(frames=9, points=6000))
