# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One track in the 3D scene: every cloud is sent once, afterwards only moved, shown and hidden."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.registration import fuse_scans
from wildshape.io.boxes.detections import pose_of
from wildshape.records import Box, Points, Track
from wildshape.report.content import BLUE, GREEN, GREY, ORANGE
from wildshape.report.scene import TRUTH_POINTS, box_segments
from wildshape.report.viewer.colours import PLAIN, WRONG, Rgb, by_height, completed_colours, rgb
from wildshape.report.viewer.drawing_frame import (
    Hold,
    as_node,
    draw_from_middle,
    draw_from_sensor,
    moved_by,
    upright,
)
from wildshape.report.viewer.registrations import AFTER, BEFORE, Moves, moves
from wildshape.report.viewer.sources import CompletedScan, true_shape

if TYPE_CHECKING:
    from viser import ViserServer

POINTS_A_CLOUD, POINTS_FUSED = 4096, 40_000
_DOT_M, _FUSED_DOT_M = 0.03, 0.02
_SIZE_M = 4.5  # dots, lines and axes are made for a car and grow with the object
_UNIT_BOX = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.0, 0.0, 0.0))


@dataclass(frozen=True)
class Wish:
    """What the panel asks for.

    Attributes:
        shown: of `scan`, `completed`, `box`, `axes`, `fused`, `truth`.
        way: whose poses fuse the track, one of `fusing.WAYS`.
        hold: what stands still.
        colouring: of the completed shape, one of `colours.COLOURINGS`.
    """

    scan: int = 0
    shown: frozenset[str] = frozenset({"scan", "completed", "box", "axes"})
    way: str = AFTER
    hold: Hold = "sensor"
    colouring: str = PLAIN


@dataclass
class Node:
    """A cloud in the scene: points of some frame, minus `offset`, so that half floats suffice."""

    handle: Any
    offset: np.ndarray
    painted: str = PLAIN

    def place(self, T_draw_frame: SE3) -> None:
        """Put it where its frame is."""
        wxyz, position = as_node(T_draw_frame @ moved_by(self.offset))
        self.handle.wxyz, self.handle.position = wxyz, position

    def show(self, *, visible: bool) -> None:
        """Show or hide it; says nothing where nothing changes."""
        if self.handle.visible != visible:
            self.handle.visible = visible


@dataclass
class Stage:
    """What of one track is in the scene; only one thread at a time may call it."""

    server: "ViserServer"
    track: Track
    completions: dict[int, CompletedScan] = field(default_factory=dict)
    nodes: dict[tuple[str, int | str], Node] = field(default_factory=dict)
    ways: dict[str, Moves] = field(default_factory=dict)
    seen: int | None = None
    lines: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def truth(self) -> Points | None:
        """The object as it is, in its own frame."""
        return true_shape(self.track)

    def clear(self) -> None:
        """Take everything off the scene."""
        for node in self.nodes.values():
            node.handle.remove()
        for handle in self.lines.values():
            handle.remove()

    def add(self, scan: int, done: CompletedScan) -> None:
        """Take in what was made of a scan, hidden until it is asked for."""
        self.completions[scan] = done
        self._scan(scan)
        self._completed(scan)

    def moves(self, way: str) -> Moves | None:
        """One way to fuse, worked out once."""
        if way not in self.ways:
            found = moves(way, self.track, self.completions)
            if found is None:
                return None
            self.ways[way] = found
        return self.ways[way]

    def show(self, wish: Wish) -> None:
        """Make the scene what the panel asks for."""
        still = self.moves(wish.way) or self.moves(BEFORE)
        T_middle_scan = still.T_middle_scan[wish.scan] if still else SE3.identity()
        centre, middle = self.centre(wish.scan), self.centre(self.track.middle)
        kind = self.track.sensor.kind
        T_draw_sensor = draw_from_sensor(kind, centre, middle, T_middle_scan, wish.hold)
        with self.server.atomic():
            self._hide_others(wish)
            self._show_scan(wish, T_draw_sensor)
            self._show_lines(wish, T_draw_sensor)
            T_draw_middle = draw_from_middle(T_draw_sensor, T_middle_scan)
            self._show_fused(wish, T_draw_middle)
            self._show_truth(wish, T_draw_sensor)
        self.seen = wish.scan

    def centre(self, scan: int) -> np.ndarray:
        """`(3,)` the object's middle in a sensor frame, metres: of its box, if known."""
        done, points = self.completions.get(scan), self.track.scans[scan]
        if done is not None and done.box is not None:
            return np.asarray(done.box.centre, np.float64)
        if done is not None and done.points is not None and not len(points):
            return done.points.mean(0, dtype=np.float64)
        return points.mean(0, dtype=np.float64) if len(points) else np.zeros(3)

    def extent(self) -> float:
        """The object's longest side, metres, roughly."""
        middle = self.track.middle
        done = self.completions.get(middle)
        if done is not None and done.box is not None:
            return max(done.box.size)
        scan = self.track.scans[middle]
        return float(np.ptp(scan, axis=0).max()) if len(scan) else _SIZE_M

    def truth_in(self, scan: int) -> Points | None:
        """The object as it is, in a scan's sensor frame, metres."""
        poses, shape = self.track.T_sensor_object, self.truth
        return None if poses is None or shape is None else poses[scan].apply_numpy(shape)

    def _hide_others(self, wish: Wish) -> None:
        for kind in ("scan", "completed"):
            if self.seen is not None and self.seen != wish.scan and (kind, self.seen) in self.nodes:
                self.nodes[kind, self.seen].show(visible=False)

    def _show_scan(self, wish: Wish, T_draw_sensor: SE3) -> None:
        completed = self._completed(wish.scan) if wish.scan in self.completions else None
        if completed is not None and completed.painted != wish.colouring:
            completed.handle.colors = self._paint(wish)
            completed.painted = wish.colouring
        for kind, node in (("scan", self._scan(wish.scan)), ("completed", completed)):
            if node is not None:
                node.place(T_draw_sensor)
                node.show(visible=kind in wish.shown)

    def _paint(self, wish: Wish) -> Rgb:
        points, done = self._completed_points(wish.scan), self.completions[wish.scan]
        truth = self.truth_in(wish.scan) if wish.colouring == WRONG else None
        scan = self.track.scans[wish.scan]
        colours = completed_colours(wish.colouring, points, done.confidence, scan, truth)
        return self._shaded(points, BLUE) if colours is None else colours

    def _show_lines(self, wish: Wish, T_draw_sensor: SE3) -> None:
        done = self.completions.get(wish.scan, CompletedScan())
        box = None if done.box is None else pose_of(done.box)
        for kind, T_sensor_own in (("box", box), ("axes", done.pose)):
            visible = kind in wish.shown and T_sensor_own is not None
            if T_sensor_own is None or (not visible and kind not in self.lines):
                if kind in self.lines and self.lines[kind].visible:
                    self.lines[kind].visible = False
                continue
            handle = self._line(kind)
            handle.wxyz, handle.position = as_node(T_draw_sensor @ T_sensor_own)
            handle.visible = visible
        if done.box is not None and "box" in self.lines:
            self.lines["box"].scale = done.box.size

    def _line(self, kind: str) -> Any:
        if kind not in self.lines:
            scene, size = self.server.scene, self.extent()
            if kind == "box":
                self.lines[kind] = scene.add_line_segments(
                    "/box", box_segments(_UNIT_BOX), rgb(GREY), thickness=2.5,
                    thickness_units="screen",
                )  # fmt: skip
            else:
                self.lines[kind] = scene.add_frame(
                    "/axes", axes_length=0.3 * size, axes_radius=0.005 * size
                )
        return self.lines[kind]

    def _show_fused(self, wish: Wish, T_draw_middle: SE3) -> None:
        way = wish.way if self.moves(wish.way) is not None else None
        for (kind, name), node in self.nodes.items():
            if kind == "fused" and (name != way or "fused" not in wish.shown):
                node.show(visible=False)
        if way is not None and "fused" in wish.shown:
            node = self._fused(way)
            node.place(T_draw_middle)
            node.show(visible=True)

    def _show_truth(self, wish: Wish, T_draw_sensor: SE3) -> None:
        poses, visible = self.track.T_sensor_object, "truth" in wish.shown
        shape = self.truth if visible or ("truth", 0) in self.nodes else None
        if poses is None or shape is None:
            return
        node = self._cloud("truth", 0, thin(shape, TRUTH_POINTS), GREY)
        node.place(T_draw_sensor @ poses[wish.scan])
        node.show(visible=visible)

    def _scan(self, scan: int) -> Node | None:
        points = self.track.scans[scan]
        if not len(points):
            return None
        return self._cloud("scan", scan, thin(points, POINTS_A_CLOUD), ORANGE)

    def _completed(self, scan: int) -> Node | None:
        if self.completions[scan].points is None:
            return None
        return self._cloud("completed", scan, self._completed_points(scan), BLUE)

    def _completed_points(self, scan: int) -> Points:
        points = self.completions[scan].points
        return thin(points, POINTS_A_CLOUD) if points is not None else np.zeros((0, 3), np.float32)

    def _fused(self, way: str) -> Node:
        if ("fused", way) in self.nodes:
            return self.nodes["fused", way]
        fused = fuse_scans(self.track.scans, self.ways[way].T_middle_scan)
        return self._cloud("fused", way, thin(fused, POINTS_FUSED), GREEN, _FUSED_DOT_M)

    def _cloud(
        self, kind: str, key: int | str, points: Points, colour: str, dot: float = _DOT_M
    ) -> Node:
        """The node; its points are sent only when it is new."""
        if (kind, key) not in self.nodes:
            offset = points.mean(0, dtype=np.float64)
            handle = self.server.scene.add_point_cloud(
                f"/{kind}/{len(self.nodes)}",
                (points - offset).astype(np.float32),
                self._shaded(points, colour),
                point_size=dot * self.extent() / _SIZE_M,
                point_shape="circle",
                point_shading="flat",
                visible=False,
            )
            self.nodes[kind, key] = Node(handle, offset)
        return self.nodes[kind, key]

    def _shaded(self, points: Points, colour: str) -> Rgb:
        heights = upright(self.track.sensor.kind).apply_numpy(points)[:, 2]
        return by_height(heights, colour)
