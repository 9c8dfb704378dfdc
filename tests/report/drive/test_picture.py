# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive from above, measured in its pixels."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image
from tests.drives.finished_drive import CARS, FRAMES, HEIGHT, SIZE, finished_drive

from wildshape.drives.writing.playback.moments import PALETTE
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.report.drive.picture import picture_from_above, write_drive_picture
from wildshape.report.drive.scene import NOBODY, DrawnScan

WAY_M = 2.0 * (FRAMES - 1)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    return finished_drive(tmp_path_factory.mktemp("drive"))


def pixels(picture):
    with Image.open(picture if not isinstance(picture, bytes) else io.BytesIO(picture)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def places(picture, colour, near=60):
    """`(n, 2)` of the pixels of a colour: to the right, and up."""
    wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    rows, columns = np.nonzero((abs(picture - wanted) < near).all(-1))
    return np.column_stack((columns, -rows))


def in_metres(picture, at, way_m=WAY_M):
    """From the sensor's last place: ahead, and to the left; by its way, whose end is a dot."""
    white = places(picture, "#ffffff", 12)
    rows, counts = np.unique(white[:, 1], return_counts=True)
    row = rows[counts.argmax()]
    along = white[white[:, 1] == row, 0]
    assert white[abs(white[:, 1] - row) > 2, 0].min() > along.mean(), "the dot is where it ends"
    end = along.max() - 4
    return (at - (end, row)) * way_m / (end - along.min())


def driving(found, heading):
    """Twice as fast, in a world whose axes are turned."""
    turn = SE3(rotation_z(torch.tensor(heading).double()), torch.zeros(3).double())
    T = SE3(found.T_level_sensor.rotation, 2 * found.T_level_sensor.translation)
    return replace(found, T_level_sensor=turn @ T)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_vehicles_lie_and_look_where_they_do_and_the_sensor_drives_to_the_right(found, heading):
    drawn = pixels(picture_from_above(driving(found, heading), ()))
    for number, cars in enumerate(CARS.values()):
        x, y, yaw = cars[0]  # of equally full scans the first
        outline = in_metres(drawn, places(drawn, PALETTE[number])) - (x - WAY_M, y)
        inside = outline[np.linalg.norm(outline, axis=1) < 3.2]  # not its way
        assert len(inside) > 300
        front = inside[np.linalg.norm(inside, axis=1).argmax()]
        ahead = 1.3 * SIZE[0] / 2
        expected = (ahead * math.cos(yaw), ahead * math.sin(yaw))
        assert front == pytest.approx(expected, abs=0.2), number


def test_the_way_of_what_drives_is_drawn(found):
    drawn, way_m = pixels(picture_from_above(found, ())), FRAMES - 1
    x, y, _ = CARS["<7>"][-1]
    far = in_metres(drawn, places(drawn, PALETTE[1]), way_m)
    assert far[far[:, 0].argmin()] == pytest.approx((x - way_m, y), abs=0.2)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_what_stands_higher_is_brighter_and_lies_where_it_was_seen(found, heading):
    """Two squares seen in the third frame, at the ground and 3 m above it."""
    x, y, z = np.mgrid[-1:1:60j, -1:1:60j, 0:1].reshape(3, -1)
    spots = [np.column_stack((x + 4, y + at, z + up)) for at, up in ((4, 0), (-4, 3))]
    points = (np.concatenate(spots) - (0, 0, HEIGHT)).astype(np.float32)
    scan = DrawnScan(2, points, np.full(len(points), NOBODY))
    drawn = pixels(picture_from_above(driving(found, heading), [scan]))
    for colour, left in (("#303b47", 4.0), ("#d3dce3", -4.0)):
        spot = in_metres(drawn, np.median(places(drawn, colour, 16), axis=0))
        assert spot == pytest.approx((4 + 4 - WAY_M, left), abs=0.4)


def test_the_bar_is_as_long_as_it_says(found):
    drawn = pixels(picture_from_above(driving(found, 0.0), ()))
    bar = places(drawn, "#a0a8b3", 12)
    length = np.ptp(in_metres(drawn, bar[bar[:, 1] == bar[:, 1].min()]), axis=0)[0]
    assert length == pytest.approx(10.0, abs=0.2)


def test_below_are_each_vehicle_s_scan_and_its_shape(found, tmp_path):
    path = tmp_path / "drive.png"
    write_drive_picture(found, found.open_source(), path, found.vehicles[::-1])
    drawn = pixels(path)
    drawn = drawn[int(0.72 * len(drawn)) : int(0.95 * len(drawn))]
    quarters = np.array_split(drawn, 4, axis=1)
    for quarter, colour in zip(quarters, ("#ffffff", PALETTE[1], "#ffffff", PALETTE[0])):
        spots = places(quarter, colour)
        assert len(spots) > 80
        assert np.ptp(spots, axis=0)[0] > 0.4 * quarter.shape[1]


def test_names_are_drawn_as_they_are(tmp_path):
    """A track's `a$^$` ended drive in a traceback, and a Chinese name in warnings."""
    at = [(12.0, 3.5, 0.2)] * FRAMES
    odd = finished_drive(tmp_path / "odd", {"a$^$": at, "車": at})
    assert picture_from_above(odd, ())[8:12] == b"WEBP"
    first, other, part = (
        picture_from_above(finished_drive(tmp_path / f"{i}", {name: at}), ())
        for i, name in enumerate(("bus+1", "bus+2", "bus+b"))
    )
    assert first == other != part
