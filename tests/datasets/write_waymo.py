# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Small segments in the parquet layout of Waymo's Perception v2, rendered as range images.

While the TOP LiDAR turns once, the vehicle drives on, so that every column has a pose of its own.
Objects stand still within a frame and may move between frames.
"""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from pyarrow import parquet
from scipy.spatial.transform import Rotation

SEGMENT = "10023947602400723454_1120_000_1140_000"
START, PERIOD = 1552440195362591, 100_000
MOUNT = ((1.43, 0.02, 2.184), (0.9, -1.3, 148.2))  # of TOP: place, roll pitch yaw in degrees
SHAPE = (40, 900)  # the real ones are (64, 2650)
LIMITS = (-0.33, 0.05)
_KEY = [("key.segment_context_name", pa.string())]
_FRAME = [*_KEY, ("key.frame_timestamp_micros", pa.int64())]
_LASER = ("key.laser_name", pa.int8())
_TRANSFORM = pa.list_(pa.float32(), 16)  # the published files hold float32


@dataclass(frozen=True)
class Thing:
    """A box in the world that moves between frames.

    Attributes:
        kind: 1 vehicle, 2 pedestrian, 3 sign, 4 cyclist.
        frames: in which it is labelled.
        solid: boxes it is made of, as size and place in its own frame; default the labelled one.
    """

    token: str
    kind: int = 1
    size: tuple[float, float, float] = (4.7, 2.0, 1.7)
    start: tuple[float, float, float] = (872.0, 1508.0, -50.2)
    step: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw: float = 0.7
    frames: tuple[int, ...] = (0, 1, 2)
    solid: tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...] = ()

    def pose(self, frame):
        """T_world_object; upright in the vehicle's frame, as labels are."""
        place = np.add(self.start, np.multiply(self.step, frame))
        level = as_pose(vehicle_pose(frame))[0]
        return level * Rotation.from_euler("z", self.heading(frame)), place

    def heading(self, frame):
        """About z of the vehicle."""
        level = as_pose(vehicle_pose(frame))[0]
        return (level.inv() * Rotation.from_euler("z", self.yaw)).as_euler("ZYX")[0]


def vehicle_pose(t):
    """T_world_vehicle at t frames, as roll pitch yaw x y z: fast, and in a bend."""
    return np.stack(
        (
            0.01 + 0.02 * t,
            -0.015 + 0.01 * t,
            0.6 + 0.05 * t,
            860.0 + 1.6 * t,
            1500.0 + 0.4 * t,
            -51.0 + 0.02 * t,
        ),
        axis=-1,
    )


def as_pose(numbers):
    return Rotation.from_euler("xyz", numbers[..., :3]), numbers[..., 3:]


def mount():
    place, angles = MOUNT
    rotation = Rotation.from_euler("xyz", angles, degrees=True)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation.as_matrix(), place
    return matrix.astype(np.float32).astype(np.float64)  # as the file holds it


def beams(table, rows):
    """Inclination of each row from the highest down: as in a table, or spread evenly."""
    low, high = LIMITS
    share = (np.arange(rows) + 0.5) / rows
    return (low + (share**1.3 if table else share) * (high - low))[::-1]


def render(things, frame, *, table, shape):
    """Range image (H, W, 4) and pixel poses (H, W, 6), float32, by rays against boxes."""
    rows, columns = shape
    azimuth = np.pi - 2 * np.pi * (np.arange(columns) + 0.5) / columns  # from the vehicle's x
    poses = vehicle_pose(frame + np.arange(columns) / columns - 0.5).astype(np.float32)
    rotations, places = as_pose(poses.astype(np.float64))
    matrix = mount()
    up = beams(table, rows)[:, None]
    turned = azimuth - np.arctan2(matrix[1, 0], matrix[0, 0])
    level = np.cos(up)
    rays = np.stack(
        (level * np.cos(turned), level * np.sin(turned), np.sin(up) * np.ones(columns)),
        axis=-1,
    )
    T = rotations.as_matrix()
    rays = np.einsum("wij,hwj->hwi", T, rays @ matrix[:3, :3].T)
    origins = np.einsum("wij,j->wi", T, matrix[:3, 3]) + places
    ranges = np.full((rows, columns), np.inf)
    for thing in things:
        rotation, place = thing.pose(frame)
        for size, at in thing.solid or ((thing.size, (0, 0, 0)),):
            middle = place + rotation.apply(at)
            ranges = np.minimum(ranges, hit(origins, rays, size, rotation, middle))
    image = np.zeros((rows, columns, 4), np.float32)
    image[..., 0] = np.where(np.isfinite(ranges), ranges, -1.0)
    image[..., 1:] = (0.3, 0.1, -1.0)
    return image, np.broadcast_to(poses, (rows, columns, 6)).copy()


def hit(origins, rays, size, rotation, place):
    """Distance along rays (H, W, 3) from origins (W, 3) to a box; infinite where they miss."""
    R = rotation.as_matrix()
    start, way = (origins - place) @ R, rays @ R
    half = np.asarray(size) / 2
    with np.errstate(divide="ignore"):
        sides = np.stack(((-half - start) / way, (half - start) / way))
    enter, leave = sides.min(axis=0).max(axis=-1), sides.max(axis=0).min(axis=-1)
    return np.where((enter > 0) & (enter < leave), enter, np.inf)


def write_waymo(split, things, *, frames=3, table=True, shape=SHAPE):
    """All tables of a segment; other lasers and a second return are there to be left alone."""
    lidar, poses, vehicle, boxes = [], [], [], []
    for frame in range(frames):
        key = (SEGMENT, START + PERIOD * frame)
        image, pixel_poses = render(things, frame, table=table, shape=shape)
        other = np.full((5, 7, 4), 3.0, np.float32)
        lidar += [(*key, 2, *_flat(other), *_flat(other))]
        lidar += [(*key, 1, *_flat(image), *_flat(np.zeros_like(image)))]
        lidar += [(*key, 3, None, None, None, None)]
        poses += [(*key, 1, *_flat(pixel_poses))]
        rotation, place = as_pose(vehicle_pose(frame))
        T_world_vehicle = np.eye(4)
        T_world_vehicle[:3, :3], T_world_vehicle[:3, 3] = rotation.as_matrix(), place
        vehicle += [(*key, T_world_vehicle.ravel().tolist())]
        boxes += [(*key, *_box(t, frame)) for t in things if frame in t.frames]
    image = [("values", pa.list_(pa.float32())), ("shape", pa.list_(pa.int32(), 3))]
    first, second = (
        [(f"range_image_return{i}.{name}", kind) for name, kind in image] for i in (1, 2)
    )
    _write(split, "lidar", [*_FRAME, _LASER], "LiDARComponent", first + second, lidar)
    _write(split, "lidar_pose", [*_FRAME, _LASER], "LiDARPoseComponent", first, poses)
    pose = [("world_from_vehicle.transform", _TRANSFORM)]
    _write(split, "vehicle_pose", _FRAME, "VehiclePoseComponent", pose, vehicle)
    _write(split, "lidar_box", [*_FRAME, _OBJECT], "LiDARBoxComponent", _BOX, boxes)
    inclinations = beams(table, shape[0])[::-1].tolist() if table else None
    calibrations = [
        (SEGMENT, 2, np.eye(4).ravel().tolist(), -1.57, 0.52, None),
        (SEGMENT, 1, mount().ravel().tolist(), *LIMITS, inclinations),
    ]
    name = "LiDARCalibrationComponent"
    _write(split, "lidar_calibration", [*_KEY, _LASER], name, _CALIBRATION, calibrations)
    return split


_OBJECT = ("key.laser_object_id", pa.string())
_BOX = [
    *((f"box.center.{axis}", pa.float64()) for axis in "xyz"),
    *((f"box.size.{axis}", pa.float64()) for axis in "xyz"),
    ("box.heading", pa.float64()),
    ("type", pa.int8()),
    ("num_lidar_points_in_box", pa.int64()),
    ("num_top_lidar_points_in_box", pa.int64()),
]
_CALIBRATION = [
    ("extrinsic.transform", _TRANSFORM),
    ("beam_inclination.min", pa.float64()),
    ("beam_inclination.max", pa.float64()),
    ("beam_inclination.values", pa.list_(pa.float64())),
]


def _box(thing, frame):
    """In the vehicle's frame of the frame's time."""
    rotation, place = as_pose(vehicle_pose(frame))
    center = rotation.inv().apply(thing.pose(frame)[1] - place).tolist()
    return thing.token, *center, *thing.size, thing.heading(frame), thing.kind, 500, 400


def _flat(image):
    return image.ravel(), list(image.shape)


def _write(split, component, keys, name, columns, rows):
    fields = [*keys, *((f"[{name}].{column}", kind) for column, kind in columns)]
    cells = zip(*rows, strict=True) if rows else [[] for _ in fields]
    arrays = [pa.array(column, kind) for column, (_, kind) in zip(cells, fields, strict=True)]
    folder = split / component
    folder.mkdir(parents=True, exist_ok=True)
    table = pa.Table.from_arrays(arrays, schema=pa.schema(fields))
    parquet.write_table(table, folder / f"{SEGMENT}.parquet")


def picture_scene(root):
    """A car of two boxes, passed; what the documentation shows."""
    solid = (((4.7, 2.0, 0.85), (0, 0, -0.4)), ((2.6, 1.7, 0.8), (-0.4, 0, 0.45)))
    frames = tuple(range(12))
    car = Thing("Kw3hbYbGR0iVbsqyFoD9uQ", start=(875.0, 1513.0, -50.1), frames=frames, solid=solid)
    write_waymo(root / "training", [car], frames=len(frames), shape=(64, 2650))
