# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS, written by rosbags."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

CLOUD = "sensor_msgs/msg/PointCloud2"
KINDS = ("db3", "mcap", "bag")
TENTH = 10**8
_ROS1, _ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)


@dataclass(frozen=True)
class Fields:
    """How x, y, z and the time lie in a point."""

    kind: str = "f4"
    big: bool = False
    rows: int = 1
    names: str = "xyz"
    clock: tuple[str, str] | None = None


PLAIN = Fields()
_NUMBERS = {"f4": 7, "f8": 8, "i2": 3, "u4": 6}


def cloud(points, stamped, fields=PLAIN, times=None, *, ros1=False, frame="lidar"):
    """A message: a ring number, y, z, x and a time a point; rows are padded with four bytes."""
    order = ">" if fields.big else "<"
    y, z, x = (fields.names[i] for i in (1, 2, 0))
    layout = [("ring", order + "u2"), *((n, order + fields.kind) for n in (y, z, x))]
    clock, kind = fields.clock or ("unused", "f4")
    point = np.dtype([*layout, (clock, order + kind)])
    rows = np.zeros((fields.rows, len(points) // fields.rows), point)
    for name, axis in zip(fields.names, points.T):
        rows[name] = axis.reshape(rows.shape)
    if times is not None:
        rows[clock] = times.reshape(rows.shape)
    step, bytes_ = rows.itemsize, [row.tobytes() + b"\xff" * 4 for row in rows]
    types = (_ROS1 if ros1 else _ROS2).types
    assert point.fields is not None
    offsets = {str(name): entry[1] for name, entry in point.fields.items()}
    known = [(name, fields.kind) for name in fields.names] + (
        [fields.clock] if fields.clock else []
    )
    described: Any = [
        types["sensor_msgs/msg/PointField"](name, offsets[name], _NUMBERS[kind], 1)
        for name, kind in known
    ]
    time = types["builtin_interfaces/msg/Time"](*divmod(stamped, 10**9))
    header = types["std_msgs/msg/Header"](*((7,) if ros1 else ()), time, frame)
    data = np.frombuffer(b"".join(bytes_), np.uint8)
    width = rows.shape[1]
    message = types[CLOUD](
        header, fields.rows, width, described, fields.big, step, step * width + 4, data, True
    )
    return (_ROS1.serialize_ros1 if ros1 else _ROS2.serialize_cdr)(message, CLOUD)


def write_bag(
    path, kind, scans, fields=PLAIN, stamps=None, times=None, packed=False, extra=(), frames=()
):
    """A recording of scans, 0.1 s apart; its file.

    Args:
        scans: of each topic.
        packed: whether; in MCAP its chunks, or each of its `messages`.
        stamps: of each scan, nanoseconds.
        times: of each scan's points, as they are recorded.
        extra: topics of text.
        frames: the name of each scan's frame.
    """
    if kind == "bag":
        writer, types, path = Ros1Writer(path.with_suffix(".bag")), _ROS1, path.with_suffix(".bag")
        if packed:
            writer.set_compression(Ros1Writer.CompressionFormat.LZ4)
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer, types = Ros2Writer(path, version=9, storage_plugin=plugin), _ROS2
        if packed:
            chunks = kind == "mcap" and packed != "messages"
            mode = CompressionMode.STORAGE if chunks else CompressionMode.MESSAGE
            writer.set_compression(mode, CompressionFormat.ZSTD)
        path = path / f"{path.name}.{kind}"
    with writer:
        topics = {topic: writer.add_connection(topic, CLOUD, typestore=types) for topic in scans}
        for topic in extra:
            writer.add_connection(topic, "std_msgs/msg/String", typestore=types)
        for topic, taken_there in scans.items():
            for frame, points in enumerate(taken_there):
                at = 10**18 + frame * TENTH
                stamped = at if stamps is None else stamps[frame]
                taken = None if times is None else times[frame]
                name = frames[frame] if frames else "lidar"
                data = cloud(points, stamped, fields, taken, ros1=kind == "bag", frame=name)
                writer.write(topics[topic], at, data)
    return path
