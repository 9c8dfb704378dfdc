# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The points of a `sensor_msgs/PointCloud2`, and when each was taken."""

import struct
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Num

from wildshape.errors import load_library
from wildshape.io.bags.storages import CLOUD, INSTALL
from wildshape.io.scans.point_times import LIKE_TIMES, TIME_FIELDS

# sensor_msgs/PointField: the numbers of its datatypes.
_DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def stamp(data: bytes, *, cdr: bool) -> int:
    """When a message says that it was taken, nanoseconds; 0 where it does not.

    In both serializations the stamp follows four bytes: the sequence number of ROS 1, the
    encapsulation of ROS 2.
    """
    big = cdr and data[1] % 2 == 0
    seconds, nanoseconds = struct.unpack_from(">II" if big else "<II", data, 4)
    return seconds * 10**9 + nanoseconds


def frame_name(data: bytes, *, cdr: bool) -> str:
    """The frame that a message's points lie in; its name follows the stamp."""
    big = cdr and data[1] % 2 == 0
    (length,) = struct.unpack_from(">I" if big else "<I", data, 12)
    return data[16 : 16 + length].rstrip(b"\0").decode("utf-8", "replace")


class Cloud(NamedTuple):
    """The points of a message.

    Attributes:
        points: metres as recorded, those without a return included.
        clock: `(n,)` when each was taken, in the unit of its field; None without such a field.
        like: a field that may hold times, too, but is not read.
    """

    points: Float[np.ndarray, "n 3"]
    clock: Num[np.ndarray, "n"] | None
    like: str = ""


def cloud_of(data: bytes, *, cdr: bool) -> Cloud:
    """All points of a message, serialized as ROS 2 does (`cdr`) or as ROS 1 does.

    Raises:
        ValueError: no fields x, y and z, or fewer bytes than it promises.
        MissingExtraError: rosbags is not installed.
    """
    types = message_types(cdr)
    cloud = types.deserialize_cdr(data, CLOUD) if cdr else types.deserialize_ros1(data, CLOUD)
    if cloud.height > 1 and cloud.row_step < cloud.width * cloud.point_step:
        raise ValueError(f"rows of {cloud.width} points in {cloud.row_step} bytes")
    # numpy's own check of a view counts in 64 bits, which such numbers overflow.
    height, width = int(cloud.height), int(cloud.width)
    end = max(height - 1, 0) * int(cloud.row_step) + width * int(cloud.point_step)
    if end > len(cloud.data):
        raise ValueError(f"{len(cloud.data)} bytes of points, where it promises {end}")
    rows = np.ndarray(
        (cloud.height, cloud.width),
        _point(cloud),
        buffer=np.ascontiguousarray(cloud.data),
        strides=(cloud.row_step, cloud.point_step),
    )
    points = np.stack([rows[name].ravel() for name in "xyz"], 1, dtype=_precision(rows.dtype))
    clock = next((name for name in rows.dtype.names or () if name in TIME_FIELDS), None)
    like = next((field.name for field in cloud.fields if field.name in LIKE_TIMES), "")
    return Cloud(points, None if clock is None else rows[clock].ravel(), like)


def _precision(point: np.dtype) -> np.dtype:
    """Of x, y and z together, in this machine's order of bytes."""
    return np.result_type(np.float32, *(point[name] for name in "xyz"))


def _point(cloud: Any) -> np.dtype:
    """Where x, y, z and the time are in the bytes of a point."""
    order = ">" if cloud.is_bigendian else "<"
    fields = {field.name: field for field in cloud.fields}
    if not {"x", "y", "z"} <= fields.keys():
        raise ValueError(f"its points have the fields {', '.join(fields)}, but no x, y, z")
    names = [*"xyz", *[name for name in TIME_FIELDS if name in fields][:1]]
    formats = [order + _DATATYPES[fields[name].datatype] for name in names]
    # numpy's own check of a field's end counts in 32 bits.
    ends = [int(fields[name].offset) + np.dtype(of).itemsize for name, of in zip(names, formats)]
    if max(ends) > cloud.point_step:
        raise ValueError(
            f"points of {cloud.point_step} bytes with a field that ends at {max(ends)}"
        )
    return np.dtype(
        {
            "names": names,
            "formats": formats,
            "offsets": [fields[name].offset for name in names],
            "itemsize": cloud.point_step,
        }
    )


@cache
def message_types(cdr: bool) -> Any:
    """How messages are serialized by ROS 2 (`cdr`) or ROS 1.

    Raises:
        MissingExtraError: rosbags is not installed.
    """
    typesys = load_library("rosbags.typesys", "bags of ROS need rosbags", INSTALL)
    stores = typesys.Stores
    return typesys.get_typestore(stores.ROS2_HUMBLE if cdr else stores.ROS1_NOETIC)
