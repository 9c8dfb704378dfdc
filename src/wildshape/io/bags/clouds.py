# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The points of a `sensor_msgs/PointCloud2`."""

import struct
from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.errors import load_library
from wildshape.io.bags.storages import CLOUD, INSTALL

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


def points_of(data: bytes, *, cdr: bool) -> Float[np.ndarray, "n 3"]:
    """All points of a message, in metres as recorded, those without a return included.

    Args:
        data: serialized.
        cdr: as ROS 2 does; otherwise as ROS 1 does.

    Raises:
        ValueError: no fields x, y and z, or fewer bytes than it promises.
        MissingExtraError: rosbags is not installed.
    """
    types = message_types(cdr)
    cloud = types.deserialize_cdr(data, CLOUD) if cdr else types.deserialize_ros1(data, CLOUD)
    if cloud.height > 1 and cloud.row_step < cloud.width * cloud.point_step:
        raise ValueError(f"rows of {cloud.width} points in {cloud.row_step} bytes")
    rows = np.ndarray(
        (cloud.height, cloud.width),
        _point(cloud),
        buffer=np.ascontiguousarray(cloud.data),
        strides=(cloud.row_step, cloud.point_step),
    )
    return np.stack([rows[name].ravel() for name in "xyz"], 1, dtype=_precision(rows.dtype))


def _precision(point: np.dtype) -> np.dtype:
    """Of x, y and z together, in this machine's order of bytes."""
    return np.result_type(np.float32, *(point[name] for name in "xyz"))


def _point(cloud: Any) -> np.dtype:
    """Where x, y and z are in the bytes of a point."""
    order = ">" if cloud.is_bigendian else "<"
    fields = {field.name: field for field in cloud.fields}
    if not {"x", "y", "z"} <= fields.keys():
        raise ValueError(f"its points have the fields {', '.join(fields)}, but no x, y, z")
    return np.dtype(
        {
            "names": list("xyz"),
            "formats": [order + _DATATYPES[fields[name].datatype] for name in "xyz"],
            "offsets": [fields[name].offset for name in "xyz"],
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
