# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scene without a browser: what is sent, how often, and what is visible."""

from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import torch
from tests.cars import half_turned, poses_of, shape_of
from tests.report.viewer.shown import perfect, track

from wildshape.evaluation.metrics import completion_error
from wildshape.geometry.box import box_axes
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.report.viewer.colours import (
    COLOURINGS,
    CONFIDENCE,
    GUESSED,
    WRONG,
    by_distance,
    by_height,
    completed_colours,
    css,
)
from wildshape.report.viewer.details import details
from wildshape.report.viewer.registrations import AFTER, BEFORE, TRUTH
from wildshape.report.viewer.stage import POINTS_A_CLOUD, Stage, Wish

_VALUE = "<span style='text-align:right'>"


class _Scene:
    """Counts clouds; a stand-in for viser's."""

    def __init__(self) -> None:
        self.clouds: dict[str, Any] = {}

    def add_point_cloud(self, name, points, colors, visible, **_):
        assert name not in self.clouds
        assert len(points) <= POINTS_A_CLOUD or name.startswith("/fused")
        assert np.abs(points).max() < 8  # half floats are used: near the origin they are exact
        self.clouds[name] = self._handle(visible, colors)
        self.clouds[name].points = points
        return self.clouds[name]

    def add_line_segments(self, name, *_, **__):
        return self._handle(True)

    def add_frame(self, name, **_):
        return self._handle(True)

    def _handle(self, visible, colors=None):
        return SimpleNamespace(
            visible=visible, colors=colors, wxyz=None, position=None, scale=1, remove=lambda: None
        )

    def visible(self) -> set[str]:
        return {name.split("/")[1] for name, cloud in self.clouds.items() if cloud.visible}


@contextmanager
def _atomic():
    yield


def _stage(scans: int = 5, *, turned: bool = False) -> tuple[Stage, _Scene]:
    scene, shown = _Scene(), track(scans)
    shown = half_turned(shown, 1) if turned else shown
    server = SimpleNamespace(scene=scene, atomic=_atomic)
    return Stage(cast(Any, server), shown), scene


def test_clouds_are_sent_once_and_one_scan_is_seen() -> None:
    stage, scene = _stage(12)
    stage.show(Wish(3))
    assert scene.visible() == {"scan"}
    for scan in range(12):
        stage.add(scan, perfect(stage.track, scan))
    sent = len(scene.clouds)
    assert sent == 24
    wish = Wish(shown=frozenset({"scan", "completed", "box"}))
    for scan in (*range(12), *range(11, -1, -1)):
        stage.show(replace(wish, scan=scan))
        assert sum(cloud.visible for cloud in scene.clouds.values()) == 2
    assert len(scene.clouds) == sent
    stage.show(replace(wish, shown=frozenset({"fused", "truth"})))
    assert scene.visible() == {"fused", "truth"}
    stage.show(replace(wish, shown=frozenset({"fused"}), way=BEFORE))
    assert sum(cloud.visible for cloud in scene.clouds.values()) == 1


def _off(by: float) -> SE3:
    """A turn about z, radians, and as many metres along it."""
    turn = rotation_z(torch.tensor(by, dtype=torch.float64))
    return SE3(turn, by * torch.eye(3, dtype=torch.float64)[2])


def _drawn(handle: Any, points: np.ndarray) -> np.ndarray:
    """Points of a node's own frame where they are seen."""
    return points @ box_axes(handle.wxyz).T + np.array(handle.position)


def _cloud(stage: Stage, kind: str, key: int | str) -> np.ndarray:
    handle = stage.nodes[kind, key].handle
    return _drawn(handle, handle.points)


def test_everything_is_drawn_where_it_is_about_the_scan_shown() -> None:
    """Of truth, box, axes and fused scans; a turn between the scans tells their frames apart."""
    stage, _ = _stage(turned=True)
    poses, shape = poses_of(stage.track), shape_of(stage.track)
    for scan in range(5):
        done = perfect(stage.track, scan)
        assert done.box is not None
        box = replace(done.box, size=(4.0 + scan, 2.0, 1.5))
        stage.add(scan, replace(done, box=box, pose=poses[scan] @ _off(0.2)))
    own = {"box": np.eye(3), "axes": _off(0.2).apply_numpy(np.eye(3))}
    wish = Wish(shown=frozenset({"scan", "completed", "box", "axes", "truth", "fused"}), way=TRUTH)
    for scan, hold in ((4, "sensor"), (1, "sensor"), (4, "object"), (1, "object")):
        stage.show(replace(wish, scan=scan, hold=cast(Any, hold)))
        kept = scan if hold == "sensor" else stage.track.middle  # whose axes are the drawing's
        T_kept_scan = poses[kept] @ poses[scan].inverse()
        centre = poses[kept].translation.numpy()

        def seen(points: np.ndarray, T=T_kept_scan, centre=centre) -> np.ndarray:
            return T.apply_numpy(points) - centre

        measured, done = stage.track.scans[scan], stage.completions[scan]
        assert done.points is not None
        assert done.box is not None
        expected = {
            ("scan", scan): measured,
            ("completed", scan): done.points,
            ("truth", 0): poses[scan].apply_numpy(shape),
        }
        for (kind, key), points in expected.items():
            np.testing.assert_allclose(_cloud(stage, kind, key), seen(points), atol=1e-4)
        fused = _cloud(stage, "fused", TRUTH)[300 * scan : 300 * scan + 300]
        np.testing.assert_allclose(fused, seen(measured), atol=1e-4)
        for kind, corners in own.items():
            place = seen(poses[scan].apply_numpy(corners))
            np.testing.assert_allclose(_drawn(stage.lines[kind], np.eye(3)), place, atol=1e-4)
        assert stage.lines["box"].scale == done.box.size


def test_colours_and_errors_are_those_of_the_scan_shown() -> None:
    stage, _ = _stage()
    poses, shape = poses_of(stage.track), shape_of(stage.track)
    blue = completed_colours(CONFIDENCE, np.zeros((1, 3), np.float32), 1.0, shape, None)
    for scan in range(5):
        done = perfect(stage.track, scan)
        points = stage.track.scans[scan] + np.array((0, 0, 0.1 * scan), np.float32)
        stage.add(scan, replace(done, pose=poses[scan] @ _off(0.1 * scan), points=points))
    for scan in (4, 1):
        told = details(stage, Wish(scan, way=AFTER))
        points = stage.completions[scan].points
        assert points is not None
        cd = completion_error(points, poses[scan].apply_numpy(shape)).cd
        assert f">{cd:.3f} m<" in told
        off = 0.1 * abs(scan - stage.track.middle)
        assert f"to the middle scan</span>{_VALUE}{np.rad2deg(off):.1f}°, {off:.2f} m<" in told
        assert f">{np.linalg.norm(poses[scan].translation):.1f} m<" in told
        assert stage.track.scan_names[scan] in told
    for colouring in (GUESSED, WRONG):
        stage, _ = _stage()
        for scan in range(5):
            points = stage.track.scans[scan] if colouring == GUESSED else stage.truth_in(scan)
            stage.add(scan, replace(perfect(stage.track, scan), points=points))
            stage.show(Wish(scan, colouring=colouring))
            colours = stage.nodes["completed", scan].handle.colors
            assert np.abs(colours.astype(int) - blue).max() <= 1


def test_every_colouring_and_every_fact_can_be_shown() -> None:
    stage, scene = _stage()
    stage.add(2, replace(perfect(stage.track, 2), warning="<odd>"))
    painted = scene.clouds["/completed/1"]
    seen = []
    for colouring in COLOURINGS:
        stage.show(Wish(2, colouring=colouring))
        seen.append(painted.colors.copy())
        told = details(stage, Wish(2, colouring=colouring))
        assert "car &lt;b&gt;" in told
        assert "&lt;odd&gt;" in told
    assert all((a != b).any() for a, b in pairwise(seen))
    assert "not yet" in details(stage, Wish(0))


def test_colours_say_how_far_and_how_high() -> None:
    points = np.zeros((2, 3), np.float32)
    points[1, 0] = 1.0
    near, far = by_distance(points, points[:1], 0.5).astype(int)
    assert near[2] - near[0] > 100  # blue
    assert far[0] - far[2] > 100  # orange
    small = completed_colours(GUESSED, points / 10, None, points[:1], None)
    assert small is not None  # of an object of 10 cm its other end is far
    assert small[1].tolist() == by_distance(points, points[:1], 0.5)[1].tolist()
    sure, doubted = (
        completed_colours(CONFIDENCE, points, confidence, points, None) for confidence in (1.0, 0.0)
    )
    assert sure is not None
    assert doubted is not None
    assert (sure == near).all()
    assert (doubted == far).all()
    assert css(1.0) == "rgb({},{},{})".format(*near)
    low, high = by_height(np.array([0.0, 1.0]), "#0072b2").astype(int)
    assert high.sum() > low.sum()
    assert GUESSED in COLOURINGS
