# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes as a table of Argoverse 2: `annotations.feather`, a row a box."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wildshape.errors import load_library
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import atomic_write
from wildshape.io.boxes.detections import Detection, moved, number_of

_CATEGORIES = {"": "REGULAR_VEHICLE", "car": "REGULAR_VEHICLE"}


def write_argoverse2_boxes(
    path: Path, detections: Sequence[Detection], T_ego_sensor: SE3 | None = None
) -> None:
    """Write a feather table with the columns of Argoverse 2's labels, and `score`.

    The data set's boxes are in the egovehicle frame; without `T_ego_sensor` they stay in the
    sensor's.

    Raises:
        MissingExtraError: pyarrow is not installed.
    """
    pyarrow = load_pyarrow()
    from pyarrow import feather

    boxes = [
        one.box if T_ego_sensor is None else moved(one.box, T_ego_sensor) for one in detections
    ]
    numbers = {
        name: pyarrow.array([getattr(box, part)[i] for box in boxes], pyarrow.float64())
        for part, names in (
            ("size", ("length_m", "width_m", "height_m")),
            ("quaternion_wxyz", ("qw", "qx", "qy", "qz")),
            ("centre", ("tx_m", "ty_m", "tz_m")),
        )
        for i, name in enumerate(names)
    }
    kinds = [_CATEGORIES.get(c.lower(), c.upper()) for c in (one.category for one in detections)]
    table = pyarrow.table(  # every type is said, for a drive may have no vehicle
        {
            "timestamp_ns": pyarrow.array(list(map(_time, detections)), pyarrow.int64()),
            "track_uuid": pyarrow.array([one.track for one in detections], pyarrow.string()),
            "category": pyarrow.array(kinds, pyarrow.string()),
            **numbers,
            "num_interior_pts": pyarrow.array(list(map(_points, detections)), pyarrow.int64()),
            "score": pyarrow.array([one.score for one in detections], pyarrow.float64()),
        }
    )
    with atomic_write(path) as file:
        feather.write_feather(table, file)


def _time(one: Detection) -> int:
    """The scan's time, or else what its name counts, which may be a time, or else its number."""
    return number_of(one.scan, one.scan_number) if one.time_ns is None else one.time_ns


def _points(one: Detection) -> int:
    return -1 if one.points is None else one.points


def load_pyarrow() -> Any:
    """The library.

    Raises:
        MissingExtraError: it is not installed.
    """
    install = "pip install 'wildshape[arrow]'"
    return load_library("pyarrow", "Argoverse 2's boxes need pyarrow", install)
