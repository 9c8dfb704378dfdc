# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The parquet tables of one Waymo segment, those that the TOP LiDAR's labelled objects need."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.datasets.tracks.labelled_boxes import check_boxes
from wildshape.datasets.waymo.footer import row_groups
from wildshape.datasets.waymo.range_image import uniform_inclinations
from wildshape.errors import BadInputError, load_library
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import reading

COMPONENTS = ("lidar", "lidar_box", "lidar_calibration", "lidar_pose", "vehicle_pose")
WITHOUT_LABELS = ("lidar", "lidar_calibration", "lidar_pose", "vehicle_pose")
TYPES = {1: "vehicle", 2: "pedestrian", 3: "sign", 4: "cyclist"}
_TOP = 1
_TIME, _LASER, _OBJECT = "key.frame_timestamp_micros", "key.laser_name", "key.laser_object_id"
_POSE = "[VehiclePoseComponent].world_from_vehicle.transform"
_EXTRINSIC = "[LiDARCalibrationComponent].extrinsic.transform"
_BEAMS = "[LiDARCalibrationComponent].beam_inclination"
_BOX = "[LiDARBoxComponent]"
_CENTRE = tuple(f"{_BOX}.box.center.{axis}" for axis in "xyz")
_SIZE = tuple(f"{_BOX}.box.size.{axis}" for axis in "xyz")
_BUFFER = 1 << 20
_MAY_BE_EMPTY = (".values", ".min", ".max")
_LONGEST = 64  # of lists of fixed length, which take room in rows that are empty, too
_FREE_ROWS, _ROW_BYTES = 100_000, 45
_MOST_VALUES = 1 << 22  # a row: TOP's largest image has 64 x 2650 pixels of 6


@dataclass(frozen=True)
class Calibration:
    """Of the TOP LiDAR.

    Attributes:
        table: inclination of each beam, radians, lowest first; None if they are spread evenly.
        limits: least and largest inclination, radians, where there is no table.
        path: of the file that it was read from.
    """

    T_vehicle_sensor: SE3
    table: np.ndarray | None
    limits: tuple[float, float]
    path: Path

    def inclinations(self, rows: int) -> np.ndarray:
        """One of each row, radians, lowest first.

        Raises:
            BadInputError: the table is of another number of rows.
        """
        if self.table is None:
            return uniform_inclinations(*self.limits, rows)
        if len(self.table) != rows:
            raise BadInputError(
                f"{self.path}: lists {len(self.table)} beams of the TOP LiDAR, whose range image "
                f"has {rows} rows; download both again, from one release."
            )
        return self.table


@dataclass(frozen=True)
class Labelled:
    """One object's box in one frame.

    Attributes:
        token: of the object, the same in all frames of the segment.
        category: see `TYPES`.
        size: full lengths along its own x, y, z, metres.
        T_vehicle_object: one pose, origin at the box's centre.
    """

    token: str
    category: str
    size: tuple[float, float, float]
    T_vehicle_object: SE3


def read_calibration(path: Path) -> Calibration:
    """The TOP LiDAR's.

    Raises:
        BadInputError: the table is missing, damaged or has no such LiDAR.
    """
    wanted = (_LASER, _EXTRINSIC, f"{_BEAMS}.min", f"{_BEAMS}.max", f"{_BEAMS}.values")
    for laser, extrinsic, low, high, values in _read_rows(path, wanted):
        if laser == _TOP:
            with reading(path, "inclinations of beams"):
                table = np.asarray(values, np.float64) if values else None
                known = (low, high) if table is None else table
                if not np.isfinite(np.asarray(known, np.float64)).all():
                    raise ValueError("not finite")
            return Calibration(_pose(extrinsic, path), table, (low, high), path)
    raise BadInputError(f"{path}: no calibration of the TOP LiDAR; download the file again.")


def read_vehicle_poses(path: Path) -> dict[int, SE3]:
    """`T_world_vehicle` of each frame, by its time in microseconds, in time order.

    Raises:
        BadInputError: the table is missing or damaged.
    """
    rows = sorted(_read_rows(path, (_TIME, _POSE)))
    return {time: _pose(transform, path) for time, transform in rows}


def read_boxes(path: Path) -> dict[int, list[Labelled]]:
    """The labelled boxes of each frame, by its time in microseconds.

    Raises:
        BadInputError: the table is missing or damaged.
    """
    wanted = (_TIME, _OBJECT, f"{_BOX}.type", f"{_BOX}.box.heading", *_CENTRE, *_SIZE)
    rows = _read_rows(path, wanted)
    if not rows:
        return {}
    with reading(path, "Waymo's lidar_box table"):
        numbers = torch.as_tensor(np.asarray([row[3:] for row in rows], np.float64))
    poses = SE3(rotation_z(numbers[:, 0]), numbers[:, 1:4])
    check_boxes(numbers[:, 4:].numpy(), poses, str(path), "download the file again")
    boxes: dict[int, list[Labelled]] = {}
    for i, (time, token, kind, _, _, _, _, length, width, height) in enumerate(rows):
        category = TYPES.get(kind, "unknown")
        box = Labelled(token, category, (length, width, height), poses[i])
        boxes.setdefault(time, []).append(box)
    return boxes


def range_images(path: Path, component: str) -> Iterator[tuple[int, np.ndarray]]:
    """The TOP LiDAR's first returns frame by frame: time in microseconds, `(H, W, C)` float32.

    One image is held, however the file is cut into row groups.

    `component`: `LiDARComponent` (range, intensity, elongation, in a no-label zone) or
    `LiDARPoseComponent` (roll, pitch, yaw, x, y, z).

    Raises:
        BadInputError: the table is missing or damaged, or its frames are not in time order.
    """
    column = f"[{component}].range_image_return1"
    wanted = (_TIME, _LASER, f"{column}.values", f"{column}.shape")
    last = -1
    for batch in _batches(path, wanted, 1):
        (time,), (laser,), values, shape = (batch.column(name) for name in wanted)
        if laser.as_py() != _TOP or values.null_count:
            continue
        if not time.is_valid or time.as_py() <= last:
            raise BadInputError(f"{path}: frames are not in time order; download it again.")
        last = time.as_py()
        yield last, _image(values, shape, path)


def _image(values: Any, shape: Any, path: Path) -> np.ndarray:
    sides = shape.to_pylist()[0]
    flat = values.flatten().to_numpy(zero_copy_only=False)
    if not sides or None in sides or len(sides) != 3 or len(flat) != math.prod(sides):
        raise BadInputError(
            f"{path}: a range image of shape {sides} has {len(flat)} values; download it again."
        )
    return flat.astype(np.float32, copy=False).reshape(sides)


def _read_rows(path: Path, names: tuple[str, ...]) -> list[tuple[Any, ...]]:
    rows: list[tuple[Any, ...]] = []
    for batch in _batches(path, names, 4096):
        for name in names:
            if batch.column(name).null_count and not name.endswith(_MAY_BE_EMPTY):
                raise BadInputError(f"{path}: {name} is empty in a row; download it again.")
        rows += zip(*(batch.column(name).to_pylist() for name in names), strict=True)
    return rows


def _batches(path: Path, names: tuple[str, ...], size: int) -> Iterator[Any]:
    """The named columns, a few rows at a time; never a whole row group of images."""
    load_library("pyarrow", "parquet files need pyarrow", "pip install 'wildshape[arrow]'")
    from pyarrow import parquet

    if not path.is_file():
        raise BadInputError(f"{path}: no such file; download this component of the segment.")
    how = {"buffer_size": _BUFFER, "pre_buffer": False}
    with reading(path, "a parquet table"), parquet.ParquetFile(path, **how) as file:
        absent = [name for name in names if name not in file.schema_arrow.names]
        if absent:
            raise BadInputError(
                f"{path}: no column {absent[0]}; is this version 2 of Waymo's data?"
            )
        for name in names:
            _check_type(file.schema_arrow.field(name).type, name, path)
        _check_rows(file.metadata, names, path)
        for batch in file.iter_batches(batch_size=size, columns=list(names), use_threads=False):
            batch.validate(full=True)
            yield batch


def _check_type(kind: Any, name: str, path: Path) -> None:
    from pyarrow import types

    if name.endswith((".values", ".transform", ".shape")):
        ragged = types.is_list(kind) or types.is_large_list(kind)
        fixed = types.is_fixed_size_list(kind) and kind.list_size <= _LONGEST
        inner = kind.value_type if ragged or fixed else None
        number = types.is_integer if name.endswith(".shape") else types.is_floating
        fits = inner is not None and number(inner)
    elif name == _OBJECT:
        fits = types.is_string(kind) or types.is_large_string(kind)
    elif name.startswith("key.") or name.endswith(".type"):
        fits = types.is_integer(kind)
    else:
        fits = types.is_floating(kind)
    if not fits:
        raise BadInputError(f"{path}: {name} is of {kind}; is this version 2 of Waymo's data?")


def _check_rows(metadata: Any, names: tuple[str, ...], path: Path) -> None:
    """Refuse rows and values that are many only because they are all the same."""
    most = _FREE_ROWS + path.stat().st_size // _ROW_BYTES
    for group in row_groups(path):
        wanted = [count for name, count in group.values if name.startswith(names)]
        values = max(wanted, default=0)
        if metadata.num_rows > most or values > _MOST_VALUES * max(group.rows, 1):
            raise BadInputError(
                f"{path}: claims {metadata.num_rows} rows and {values} values in "
                f"{path.stat().st_size} bytes; download it again."
            )


def _pose(transform: list[float], path: Path) -> SE3:
    with reading(path, "4x4 transforms"):
        matrix = np.asarray(transform, np.float64).reshape(4, 4)
    try:
        return SE3.from_matrix(matrix)
    except BadInputError as error:
        raise BadInputError(f"{path}: {error}") from error
