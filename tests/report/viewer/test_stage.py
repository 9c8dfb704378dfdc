# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scene without a browser: what is sent, how often, and what is visible."""

from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from tests.report.viewer.shown import perfect, track

from wildshape.report.viewer.colours import (
    COLOURINGS,
    GUESSED,
    by_distance,
    by_height,
    completed_colours,
)
from wildshape.report.viewer.details import details
from wildshape.report.viewer.registrations import BEFORE
from wildshape.report.viewer.stage import POINTS_A_CLOUD, Stage, Wish


class _Scene:
    """Counts clouds; a stand-in for viser's."""

    def __init__(self) -> None:
        self.clouds: dict[str, Any] = {}

    def add_point_cloud(self, name, points, colors, visible, **_):
        assert name not in self.clouds
        assert len(points) <= POINTS_A_CLOUD or name.startswith("/fused")
        assert np.abs(points).max() < 8  # half floats are used: near the origin they are exact
        self.clouds[name] = self._handle(visible, colors)
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


def _stage(scans: int = 5) -> tuple[Stage, _Scene]:
    scene, shown = _Scene(), track(scans)
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


def test_every_colouring_and_every_fact_can_be_shown() -> None:
    stage, scene = _stage()
    stage.add(2, perfect(stage.track, 2))
    painted = scene.clouds["/completed/1"]
    seen = []
    for colouring in COLOURINGS:
        stage.show(Wish(2, colouring=colouring))
        seen.append(painted.colors.copy())
        assert "car &lt;b&gt;" in details(stage, Wish(2, colouring=colouring))
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
    low, high = by_height(np.array([0.0, 1.0]), "#0072b2").astype(int)
    assert high.sum() > low.sum()
    assert GUESSED in COLOURINGS
