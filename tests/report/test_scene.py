# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np

from wildshape.records import Box
from wildshape.report.content import Cloud, ReportObject
from wildshape.report.scene import box_segments, scene_of, upright


def test_box_edges_have_the_box_s_lengths_and_lie_where_it_lies() -> None:
    half = 0.5**0.5
    box = Box(
        (10.0, 2.0, -1.0), (4.0, 2.0, 1.5), (half, 0.0, 0.0, half)
    )  # forward is the sensor's y
    segments = box_segments(box)
    edges, front = segments[:12], segments[12]
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    np.testing.assert_allclose(np.sort(lengths), np.repeat((1.5, 2, 4), 4), atol=1e-5)
    np.testing.assert_allclose(edges.reshape(-1, 3).min(0), (9, 0, -1.75), atol=1e-5)
    np.testing.assert_allclose(edges.reshape(-1, 3).max(0), (11, 4, -0.25), atol=1e-5)
    np.testing.assert_allclose(front[0], (10, 4, -1), atol=1e-5)
    assert front[1, 1] > 4


def test_a_camera_s_down_is_drawn_down() -> None:
    np.testing.assert_array_equal(upright(np.array([[1.0, 2.0, 3.0]]), "camera"), [[1, 3, -2]])


def test_arrow_points_to_the_sensor_from_outside_the_cloud() -> None:
    rng = np.random.default_rng(0)
    points = (rng.uniform(-1, 1, (200, 3)) + np.array([12, -5, 1])).astype(np.float32)
    scene = scene_of(ReportObject("a", clouds=(Cloud("input scan", points),)))
    assert scene.arrow is not None
    along = scene.arrow[1] - scene.arrow[0]
    towards = -scene.middle / np.linalg.norm(scene.middle)
    np.testing.assert_allclose(along / np.linalg.norm(along), towards, atol=1e-6)
    assert ((points - scene.arrow[0]) @ towards).max() < 0
    for shown in (points, scene.arrow):
        assert (shown >= scene.low).all()
        assert (shown <= scene.high).all()


def test_no_arrow_where_the_sensor_is_inside() -> None:
    points = np.random.default_rng(0).normal(0, 1, (50, 3)).astype(np.float32)
    assert scene_of(ReportObject("a", clouds=(Cloud("truth", points),))).arrow is None
