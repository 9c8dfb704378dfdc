# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rectangles as rows of an evaluation, beside labelled boxes and with rays."""

from dataclasses import replace

import numpy as np
import pytest
from tests.cars import drive_by, poses_of, shape_of

from wildshape.baselines.named import baseline
from wildshape.baselines.rectangle import Rectangle
from wildshape.evaluation.method import SightedCompleter
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.summary import figures_of
from wildshape.io.boxes.detections import pose_of
from wildshape.records import Sensor, SightLines


class Sighted:
    """Says nothing but what it was handed."""

    def complete(self, points, sensor):
        return points

    def complete_sighted(self, scans, sensor, rays):
        # As each scan was turned, so were its rays: they end on it.
        for scan, seen in zip(scans, rays):
            assert np.allclose(seen.directions * seen.ranges[:, None], scan, atol=1e-4)
        return [Spoken(scan) for scan in scans]


@pytest.mark.parametrize("name", ["rectangle", "l-shape"])
def test_a_car_seen_from_all_sides_has_its_labelled_box(name) -> None:
    track = drive_by("a", scans=2, points=400)
    whole = tuple(pose.apply_numpy(shape_of(track)) for pose in poses_of(track))
    size = tuple(np.ptp(shape_of(track), axis=0).tolist())
    seen = replace(track, scans=whole, label_size_m=size)
    figures = figures_of(run({name: baseline(name)}, [seen], "yaw", 3).methods[0])
    bev, bias = figures["box_bev"], figures["box_length_bias_m"]
    assert bev is not None
    assert bev > 0.95
    assert bias is not None
    assert abs(bias) < 0.05
    assert figures["heading30_sym"] == 1.0
    longer = replace(seen, label_size_m=(size[0] + 1.0, *size[1:]))
    off = figures_of(run({name: baseline(name)}, [longer], "yaw", 3).methods[0])
    assert off["box_length_bias_m"] == pytest.approx(bias - 1.0, abs=1e-6)


@pytest.mark.parametrize("name", ["rectangle", "l-shape"])
def test_a_camera_that_sees_the_same_car_has_the_same_box(name) -> None:
    """A camera's x is right, its y down, its z ahead."""
    R_camera_lidar = np.array(((0, -1, 0), (0, 0, -1), (1, 0, 0)), np.float32)
    scan = drive_by("a", scans=1, points=400).scans[0]
    method = baseline(name)
    assert isinstance(method, Rectangle)
    (level,) = method.complete_many([scan], Sensor("lidar"))
    (turned,) = method.complete_many([scan @ R_camera_lidar.T], Sensor("camera"))
    assert level.box is not None
    assert turned.box is not None
    np.testing.assert_allclose(turned.box.size, level.box.size, atol=1e-5)
    T_camera_box = R_camera_lidar @ pose_of(level.box).matrix.numpy()[:3]
    np.testing.assert_allclose(pose_of(turned.box).matrix.numpy()[:3], T_camera_box, atol=1e-5)


def test_rays_reach_the_methods_that_know_them_turned_as_the_scans() -> None:
    track = drive_by("a", scans=3, points=200)
    seen = replace(track, rays=tuple(SightLines.of_returns(scan) for scan in track.scans))
    assert isinstance(Sighted(), SightedCompleter)
    for rotate in ("none", "yaw", "so3"):
        assert len(run({"m": Sighted()}, [seen], rotate, 1).methods[0].completions) == 3
