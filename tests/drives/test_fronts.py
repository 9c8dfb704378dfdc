# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which end of a vehicle is its front: where it drives to, and its shape is turned with it."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from tests.drives.objects import completed, still

from wildshape.drives.completing.boxes import faced, smooth
from wildshape.drives.config import (
    BoxConfig,
)
from wildshape.drives.writing.outputs import write_shape
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply


def test_the_front_is_where_a_vehicle_drives_to():
    boxes = [(0.5 * f, 0.0, 0.0, math.pi if f < 4 else 0.0) for f in range(6)]
    found = faced(completed(boxes), still(6), BoxConfig())
    assert found.turned
    way = smooth(found, still(6), BoxConfig())
    assert np.abs(way.boxes[:, 3]).max() < 1e-6


def test_one_scan_that_looks_aside_turns_no_other_around():
    """As a network had it in a curve; the fourth is half seen."""
    degrees = (-173, -164, -158, 115, -147, -147, -147)
    yaws = np.radians(degrees)
    places = np.cumsum(4 * np.column_stack((np.cos(yaws), np.sin(yaws))), axis=0)
    boxes = [(x, y, 0.0, yaw) for (x, y), yaw in zip(places, yaws)]
    found = faced(completed(boxes), still(len(boxes)), BoxConfig())
    assert not found.turned
    np.testing.assert_array_equal(found.boxes[:, 3], yaws)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_one_scan_turns_no_vehicle_around_that_creeps(yaw):
    x, y = 0.28 * math.cos(yaw), 0.28 * math.sin(yaw)
    boxes = [(x * f, y * f, 0.0, yaw if f else yaw + math.pi) for f in range(12)]
    found = faced(completed(boxes, tuple(range(0, 48, 4))), still(48), BoxConfig())
    assert not found.turned
    assert np.abs(np.sin((found.boxes[:, 3] - yaw) / 2)).max() < 1e-6


def test_a_stray_place_at_the_end_turns_no_vehicle_around():
    boxes = [(1.2 * f, 0.0, 0.0, 0.0) for f in range(7)]
    boxes.append((-3.0, 0.0, 0.0, 0.0))
    found = faced(completed(boxes, tuple(range(0, 32, 4))), still(32), BoxConfig())
    assert not found.turned


@pytest.mark.parametrize("yaw", [0.0, math.pi])
@pytest.mark.parametrize("then", [0.0, -0.2], ids=["stops", "backs up"])
def test_the_front_stays_the_front_whatever_comes_then(yaw, then):
    frames = tuple(range(0, 81, 4))
    boxes = [(0.5 * f if f < 40 else 20 + then * (f - 40), 4.0, 0.0, yaw) for f in frames]
    found = faced(completed(boxes, frames), still(81), BoxConfig())
    assert found.turned == (yaw != 0)
    way = smooth(found, still(81), BoxConfig())
    assert np.abs(np.sin(way.boxes[:, 3] / 2)).max() < 1e-6


def test_the_shape_of_one_turned_around_is_turned_with_its_box(tmp_path):
    """What sticks out ahead of the middle as it drives is ahead in the frame of its box."""
    box = {"centre": (5.0, 4.0, 0.0), "size": (4.0, 1.8, 1.5), "quaternion_wxyz": (0, 0, 0, 1)}
    write_ply(tmp_path / "completed" / "0.ply", np.array([[6.5, 4.2, 0.3]], np.float32))
    scan = {"scan": "0", "box": box, "confidence": 0.9, "cost_m": 0.1}
    said = {"track": "a", "sensor": "lidar", "category": "car", "scans": [scan]}
    (tmp_path / "objects.json").write_text(json.dumps(said), encoding="utf-8")
    one = completed([(5.0, 4.0, 0.0, 0.0)])
    for turned, expected in ((True, (1.5, 0.2, 0.2)), (False, (-1.5, -0.2, 0.2))):
        write_shape(
            tmp_path / f"{turned}.ply",
            tmp_path,
            replace(one, turned=turned, raised_m=0.1),
        )
        assert read_points(tmp_path / f"{turned}.ply")[0] == pytest.approx(expected, abs=1e-5)
