# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Small scenes in nuScenes' own layout, byte for byte, with known objects."""

import hashlib
import json
import random
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from tests.cars import car_surface

SENSORS = {  # channel: (translation, roll pitch yaw in degrees); LIDAR_TOP is y forward
    "LIDAR_TOP": ((0.94, 0.02, 1.84), (1.2, -0.7, -89.6)),
    "CAM_FRONT": ((1.70, 0.01, 1.51), (-90.4, 0.3, -90.1)),
}


@dataclass(frozen=True)
class Thing:
    """A box that moves evenly: place and heading are linear in time."""

    name: str
    category: str = "vehicle.car"
    size: tuple[float, float, float] = (4.6, 1.9, 1.6)  # length width height
    start: tuple[float, float, float] = (412.0, 1182.0, 0.9)
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.4
    yaw_rate: float = 0.0
    keys: tuple[int, ...] = (0, 1, 2, 3)  # the key frames in which it is labelled
    is_car: bool = False  # the sides of `tests.cars` that face the sensor, instead of the box

    def pose(self, t):
        """T_global_object at t seconds."""
        rotation = Rotation.from_euler("z", self.yaw + self.yaw_rate * t)
        return rotation, np.add(self.start, np.multiply(self.velocity, t))


@dataclass(frozen=True)
class Scene:
    name: str = "scene-0061"
    things: tuple[Thing, ...] = ()
    keys: int = 4
    sweeps_between: int = 4


def token(*words):
    return hashlib.md5(" ".join(map(str, words)).encode()).hexdigest()


def ego_pose(t):
    """T_global_ego: along a bend, rolling a little."""
    angles = (0.5 + 0.2 * t, -0.4, 31.0 + 9.0 * t)
    return Rotation.from_euler("xyz", angles, degrees=True), np.array((400.0 + 8 * t, 1180.0, 0.0))


def sensor_pose(channel):
    translation, angles = SENSORS[channel]
    return Rotation.from_euler("xyz", angles, degrees=True), np.asarray(translation)


def box_surface(size, count, seed):
    """Points on a box's sides and top, above the strip that readers cut off at its floor."""
    rng = np.random.default_rng(seed)
    half = np.asarray(size) / 2
    points = rng.uniform(-half, half, (count, 3))
    points[:, 2] = rng.uniform(-half[2] + 0.25, half[2], count)
    faces = np.array(((0, 1), (0, -1), (1, 1), (1, -1), (2, 1)))[rng.integers(5, size=count)]
    points[np.arange(count), faces[:, 0]] = faces[:, 1] * half[faces[:, 0]]
    return points


def facing(eye, count, seed):
    """Points on the small car of `tests.cars` that a sensor at `eye` may see, 1 cm of noise."""
    points, normals = car_surface(10 * count, seed)
    seen = points[((eye - points) * normals).sum(axis=1) > 0][:count]
    return seen + np.random.default_rng(seed).normal(scale=0.01, size=seen.shape)


def off_surface(points, size):
    """How far points lie from a box's surface."""
    away = np.abs(points) - np.asarray(size) / 2
    outside = np.linalg.norm(np.maximum(away, 0), axis=1)
    return np.abs(outside + np.minimum(away.max(axis=1), 0))


def cloud_at(scene, t, count):
    """What LIDAR_TOP sees at t: the things' surfaces and some world, in its own frame."""
    world = np.random.default_rng(7).uniform((330, 1100, -1), (470, 1260, 6), (200, 3))
    parts = [world]
    for number, thing in enumerate(scene.things):
        rotation, place = thing.pose(t)
        if thing.is_car:
            ego, sensor = ego_pose(t), sensor_pose("LIDAR_TOP")
            eye = rotation.inv().apply(ego[0].apply(sensor[1]) + ego[1] - place)
            surface = facing(eye, count, round(10 * t))
        else:
            surface = box_surface(thing.size, count, number)
        parts.append(rotation.apply(surface) + place)
    points = np.concatenate(parts)
    for rotation, place in (ego_pose(t), sensor_pose("LIDAR_TOP")):
        points = rotation.inv().apply(points - place)
    return points


def write_nuscenes(root, scenes, *, version="v1.0-mini", sweeps=True, count=400):
    """Tables and files of the scenes; rows in no order, as in the real tables."""
    rows = {name: [] for name in _NAMES}
    rows["sensor"] = [
        {"token": token(c), "channel": c, "modality": "lidar" if "LIDAR" in c else "camera"}
        for c in SENSORS
    ]
    for scene in scenes:
        _add_scene(rows, scene, root, sweeps, count)
    shuffle = random.Random(3)
    (root / version).mkdir(parents=True, exist_ok=True)
    for name, table in rows.items():
        shuffle.shuffle(table)
        (root / version / f"{name}.json").write_text(json.dumps(table, indent=0))
    return root


_NAMES = (
    *("attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map"),
    *("sample", "sample_annotation", "sample_data", "scene", "sensor", "visibility"),
)


def _add_scene(rows, scene, root, sweeps, count):
    name = scene.name
    samples = [token(name, "sample", key) for key in range(scene.keys)]
    rows["scene"].append(
        {
            "token": token(name),
            "name": name,
            "description": "a \\ test, \"{]\" and 'umlaut' \u00fc",
            "log_token": token(name, "log"),
            "nbr_samples": scene.keys,
            "first_sample_token": samples[0],
            "last_sample_token": samples[-1],
        }
    )
    for channel in SENSORS:
        rows["calibrated_sensor"].append(
            {
                "token": token(name, channel),
                "sensor_token": token(channel),
                **_pose(*sensor_pose(channel)),
                "camera_intrinsic": [],
            }
        )
    for key in range(scene.keys):
        time = 1532402927647951 + 500_000 * key
        rows["sample"].append(
            {"token": samples[key], "timestamp": time, "scene_token": token(name)}
            | _links(samples, key)
        )
    _add_things(rows, scene, samples)
    _add_data(rows, scene, samples, root, sweeps, count)


def _add_things(rows, scene, samples):
    for thing in scene.things:
        category, instance = token(thing.category), token(scene.name, thing.name)
        if category not in {row["token"] for row in rows["category"]}:
            rows["category"].append({"token": category, "name": thing.category, "description": ""})
        marks = [token(instance, key) for key in thing.keys]
        rows["instance"].append(
            {
                "token": instance,
                "category_token": category,
                "nbr_annotations": len(marks),
                "first_annotation_token": marks[0],
                "last_annotation_token": marks[-1],
            }
        )
        length, width, height = thing.size
        for i, key in enumerate(thing.keys):
            rows["sample_annotation"].append(
                {
                    "token": marks[i],
                    "sample_token": samples[key],
                    "instance_token": instance,
                    "visibility_token": "4",
                    "attribute_tokens": [],
                    **_pose(*thing.pose(0.5 * key)),
                    "size": [width, length, height],
                    **_links(marks, i),
                    "num_lidar_pts": 400,
                    "num_radar_pts": 0,
                }
            )


def _add_data(rows, scene, samples, root, sweeps, count):
    steps = scene.sweeps_between + 1
    for step in range((scene.keys - 1) * steps + 1):
        t = 0.5 * step / steps
        key = step % steps == 0
        for channel in SENSORS if key else ("LIDAR_TOP",):
            micros = 1532402927647951 + round(1e6 * t)
            folder = f"{'samples' if key else 'sweeps'}/{channel}"
            suffix = "pcd.bin" if channel == "LIDAR_TOP" else "jpg"
            file = f"{folder}/n015-2018-07-24__{scene.name}__{channel}__{micros}.{suffix}"
            data = token(scene.name, channel, step)
            rows["sample_data"].append(
                {
                    "token": data,
                    "sample_token": samples[-(-step // steps)],  # the one that follows
                    "ego_pose_token": data,
                    "calibrated_sensor_token": token(scene.name, channel),
                    "timestamp": micros,
                    "fileformat": "pcd" if channel == "LIDAR_TOP" else "jpg",
                    "is_key_frame": key,
                    "height": 0,
                    "width": 0,
                    "filename": file,
                    "prev": "",
                    "next": "",
                }
            )
            lag = 0.0 if channel == "LIDAR_TOP" else 0.03
            rows["ego_pose"].append(
                {"token": data, "timestamp": micros, **_pose(*ego_pose(t + lag))}
            )
            if channel == "LIDAR_TOP" and (key or sweeps):
                _write_cloud(root / file, cloud_at(scene, t, count))


def _write_cloud(path, points):
    ring = np.arange(len(points)) % 32
    columns = np.column_stack((points, np.full(len(points), 17.0), ring))
    path.parent.mkdir(parents=True, exist_ok=True)
    columns.astype("<f4").tofile(path)


def _pose(rotation, translation):
    x, y, z, w = rotation.as_quat().tolist()
    return {"translation": np.asarray(translation).tolist(), "rotation": [w, x, y, z]}


def _links(tokens, i):
    return {
        "prev": tokens[i - 1] if i else "",
        "next": tokens[i + 1] if i + 1 < len(tokens) else "",
    }


RELATIVES = {  # folder of tables, channel, folder in the tables, folder on the disk, suffix
    "lyft": ("train_data", "LIDAR_TOP", "lidar", "train_lidar", ".bin"),
    "truckscenes": ("v1.0-mini", "LIDAR_LEFT", "{}/LIDAR_LEFT", "{}/LIDAR_LEFT", ".pcd"),
    "t4": ("annotation", "LIDAR_CONCAT", "data/LIDAR_CONCAT", "data/LIDAR_CONCAT", ".pcd.bin"),
}


def write_relative(root, kind, scenes):
    """The same scenes as a data set that took over nuScenes' tables lays them out."""
    tables, channel, said, there, suffix = RELATIVES[kind]
    write_nuscenes(root, scenes)
    for file in sorted(root.glob("s*s/LIDAR_TOP/*.pcd.bin")):
        place = root / there.format(file.parts[-3]) / file.name.replace(".pcd.bin", suffix)
        place.parent.mkdir(parents=True, exist_ok=True)
        if suffix == ".pcd":
            _write_pcd(place, np.fromfile(file, "<f4").reshape(-1, 5))
        else:
            place.write_bytes(file.read_bytes())
        file.unlink()
    (root / "v1.0-mini").rename(root / tables)
    for name in ("sensor", "sample_data"):
        rows = json.loads((root / tables / f"{name}.json").read_text())
        for row in rows:
            if row.get("channel") == "LIDAR_TOP":
                row["channel"] = channel
            if "LIDAR_TOP" in row.get("filename", ""):
                folder, _, file = row["filename"].split("/")
                renamed = file.replace(".pcd.bin", suffix)
                row["filename"] = f"{said.format(folder)}/{renamed}"
        (root / tables / f"{name}.json").write_text(json.dumps(rows))
    return root


def _write_pcd(path, rows):
    """Each point has its own microsecond of Unix time: a turn of 100 ms around the file's."""
    head = (
        "VERSION 0.7\nFIELDS x y z intensity timestamp\nSIZE 4 4 4 4 8\nTYPE F F F F U\n"
        f"COUNT 1 1 1 1 1\nWIDTH {len(rows)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {len(rows)}\nDATA binary\n"
    )
    whole = np.zeros(len(rows), [(name, "<f4") for name in "xyzi"] + [("timestamp", "<u8")])
    for column, name in enumerate("xyzi"):
        whole[name] = rows[:, column]
    whole["timestamp"] = int(path.stem.split("__")[-1]) - 50_000
    whole["timestamp"] += (np.arange(len(rows)) * 100_000 // len(rows)).astype(np.uint64)
    path.write_bytes(head.encode() + whole.tobytes())


def picture_scene(root):
    """A small car, passed; what the documentation shows."""
    keys = tuple(range(8))
    car = Thing("car", size=(4.2, 1.7, 1.5), start=(415.0, 1188.0, 0.9), keys=keys, is_car=True)
    write_nuscenes(root, [Scene(things=(car,), keys=len(keys), sweeps_between=0)])
