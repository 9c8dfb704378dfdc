# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes are held to labels where there are some."""

import math
from dataclasses import replace

import numpy as np
import pytest
from experiments.labelled_boxes import COLUMNS, _error, _on_points, labelled

from wildshape.errors import BadInputError
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.io.write_tracks import write_tracks


def written(path, tracks):
    write_tracks(tracks, path, "packed", command="test", settings={})
    return path


def test_only_tracks_whose_boxes_are_known_are_measured(cars, tmp_path):
    known, unposed = cars[0], replace(cars[1], T_sensor_object=None)
    bare = replace(cars[2], shape=None)
    assert [one.name for one in labelled(written(tmp_path / "some", (unposed, known, bare)))] == [
        known.name
    ]
    none = written(tmp_path / "none", (unposed, bare))
    with pytest.raises(BadInputError, match="none: no track has true poses"):
        labelled(none)


def seen_from(azimuth, *box):
    """A box of a frame as a sensor sees it that is turned by so much."""
    x, y, z, length, width, height, yaw = box
    c, s = math.cos(azimuth), math.sin(azimuth)
    return UprightBox(c * x - s * y, s * x + c * y, z, length, width, height, yaw=yaw + azimuth)


@pytest.mark.parametrize("azimuth", [0.0, 0.7, 2.5, -1.9])
def test_ends_are_near_and_far_as_the_sensor_sees_them(azimuth):
    """0.4 m longer at the far end, 0.2 m wider at the near side, 0.2 m higher, turned around."""
    label = seen_from(azimuth, 10.0, 5.0, 0.0, 4.0, 2.0, 1.5, 0.0)
    found = seen_from(azimuth, 10.2, 4.9, 0.1, 4.4, 2.2, 1.7, math.pi)
    off = dict(zip(COLUMNS, _error(found, label)))
    shared, own = 4.0 * 2.0, 4.4 * 2.2
    expected = {
        "length": 0.4, "width": 0.2, "roof": 0.2, "floor": 0.0,
        "near end": 0.0, "far end": 0.4, "near side": 0.2, "far side": 0.0,
        "away": (0.2 * 10.0 - 0.1 * 5.0) / math.hypot(10.0, 5.0),
        "BEV IoU": shared / own, "3D IoU": 1.5 * shared / (1.7 * own), "heading off, %": 0.0,
    }  # fmt: skip
    assert off == pytest.approx(expected, abs=1e-6)
    for degrees, share in ((9.0, 0.0), (11.0, 100.0), (-169.0, 100.0)):
        turned = label._replace(yaw=label.yaw + math.radians(degrees))
        assert _error(turned, label)[-1] == share


@pytest.mark.parametrize("azimuth", [0.0, 0.7, 2.5, -1.9])
def test_a_label_is_put_where_the_scan_touches_its_near_end_and_side(azimuth):
    """The points stop 0.5 m before the label's near end and 0.3 m outside its near side."""
    label = seen_from(azimuth, 10.0, 5.0, 0.0, 4.0, 2.0, 1.5, 0.0)
    grid = np.linspace(0.0, 1.0, 201)
    corner = np.array([(8.5, 3.7 + t, 0.0) for t in grid] + [(8.5 + t, 3.7, 0.0) for t in grid])
    c, s = math.cos(azimuth), math.sin(azimuth)
    scan = corner @ np.array(((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)))
    put = _on_points(label, scan.astype(np.float32))
    assert put == pytest.approx(label._replace(x=put.x, y=put.y))
    back = seen_from(-azimuth, *put)
    assert (back.x, back.y) == pytest.approx((10.5, 4.7), abs=1e-3)
