# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A scene in PandaSet's layout."""

import json
import math

import numpy as np
from tests.datasets.street import SIZE, moved, rigid, street, wxyz
from tests.datasets.write_pandas import write_frame

UUIDS = {
    "parked": "2c4dbdea-845e-4d29-8a94-9c86feb536fe",
    "moving": "0c23bb23-696c-4e11-bca3-184b877ca0d9",
}
SIBLING = "e5ad8a8c-8a62-4e7e-a08b-3a8a51ba0fd6"
STAMPS = [1557539924.49981 + 0.1 * i for i in range(80)]
AGO = {"parked": 0.08, "moving": 0.03}
"""When the beams passed a car, before the end of the sweep, seconds."""
# The base: x right, y forward, z up.
T_EGO_BASE = rigid(0, 0, 0, yaw=-math.pi / 2)


def write_scene(folder, scene, label="Car"):
    """Write the parts of a scene that are read; returns its folder."""
    write_poses(folder, scene)
    for i, cloud in enumerate(scene.clouds):
        write_cuboids(folder, scene, i, label)
        write_sweep(folder / f"lidar/{i:02d}.pkl.gz", *with_times(scene, i, cloud))
    return folder


def write_poses(folder, scene):
    poses = []
    for T_world_ego in scene.T_world_ego:
        T = T_world_ego @ T_EGO_BASE
        position = dict(zip("xyz", T[:3, 3].tolist()))
        poses.append({"position": position, "heading": dict(zip("wxyz", wxyz(T)))})
    (folder / "lidar").mkdir(parents=True, exist_ok=True)
    (folder / "lidar" / "poses.json").write_text(json.dumps(poses))
    (folder / "lidar" / "timestamps.json").write_text(json.dumps(STAMPS[: len(poses)]))


def write_cuboids(folder, scene, i, label):
    """The moving car has a label for each of the two LiDARs."""
    rows = [("parked", UUIDS["parked"], -1, "-"), ("moving", UUIDS["moving"], 0, SIBLING)]
    rows += [("moving", SIBLING, 1, UUIDS["moving"])]
    places = [scene.T_world_object[row[0]][i] for row in rows]
    length, width, height = (np.full(len(rows), extent) for extent in SIZE)
    # Faces along its own y.
    yaws = [math.atan2(T[1, 0], T[0, 0]) - math.pi / 2 for T in places]
    columns = {
        "uuid": text([row[1] for row in rows]),
        "label": text([label] * len(rows)),
        "yaw": np.array(yaws),
        "stationary": np.array([row[2] < 0 for row in rows]),
        "camera_used": np.full(len(rows), -1),
    }
    columns |= {f"position.{a}": np.array([T[k, 3] for T in places]) for k, a in enumerate("xyz")}
    columns |= {"dimensions.x": width, "dimensions.y": length, "dimensions.z": height}
    columns |= {"attributes.object_motion": text([float("nan")] * len(rows))}
    columns |= {"cuboids.sibling_id": text([row[3] for row in rows])}
    columns |= {"cuboids.sensor_id": np.array([row[2] for row in rows])}
    write_frame(folder / f"annotations/cuboids/{i:02d}.pkl.gz", columns)


def text(values):
    column = np.empty(len(values), object)
    column[:] = values
    return column


def with_times(scene, i, cloud):
    """Points, times and LiDARs: those of the Pandar64, and as many of the PandarGT, 10 cm off."""
    times = np.full(len(cloud), STAMPS[i] - 0.05)
    for name, places in scene.T_world_object.items():
        near = np.abs(moved(np.linalg.inv(places[i]), cloud)).max(axis=1) < 3
        times[near] = STAMPS[i] - AGO[name]
    both = np.concatenate((cloud, cloud + 0.1))
    return both, np.tile(times, 2), np.repeat((0, 1), len(cloud))


def write_sweep(path, points, times, lidars):
    columns = {axis: points[:, k] for k, axis in enumerate("xyz")}
    columns |= {"i": np.full(len(points), 7.0), "t": times, "d": lidars.astype(np.int64)}
    write_frame(path, columns)


def picture_scene(root):
    """A parked car, passed; what the documentation shows."""
    write_scene(root / "pandaset" / "001", street(frames=9, points=6000))
