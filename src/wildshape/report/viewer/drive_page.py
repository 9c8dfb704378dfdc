# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a drive: its scene over time, and every vehicle with its shape when it is clicked."""

import threading
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from wildshape.drives.source import Drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle
from wildshape.drives.writing.playback.moments import colour_of, readable_source
from wildshape.errors import BadInputError
from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detections import pose_of
from wildshape.io.progress import counted
from wildshape.records import Box, Points
from wildshape.report.drive.scene import (
    NOBODY,
    SceneConfig,
    boxes_by_frame,
    points_a_shape,
    thinned,
)
from wildshape.report.results import box_of, chances_in, read_result
from wildshape.report.scene import box_segments
from wildshape.report.viewer.details import framed, row
from wildshape.report.viewer.drawing_frame import as_node
from wildshape.report.viewer.page import HOST, aim, hosting

if TYPE_CHECKING:
    from viser import ViserServer

NOTHING = "none"
LAYERS = {
    "scan": "scan",
    "shapes": "completed shapes",
    "boxes": "boxes",
    "names": "names",
    "ways": "ways",
}
_CONFIG = SceneConfig()
_DOT_M, _SHAPE_DOT_M, _CHOSEN_DOT_M, _MEASURED_DOT_M = 0.06, 0.05, 0.035, 0.02
_MEASURED = 5000  # points drawn of all that a vehicle's scans measured
_WHITE = (255, 255, 255)


def serving_drive(
    found: FinishedDrive, port: int = 0, allowed: Sequence[str] = (), moved: Path | None = None
) -> AbstractContextManager["DrivePage"]:
    """The page of a drive for as long as the block runs; arguments and errors as of `serving`.

    `moved` is where the recording is now, if it is no longer where it was.

    Raises:
        BadInputError: `moved` is another recording.
    """
    drive = found.open_source(moved) if moved else readable_source(found)
    return hosting(
        found.name, lambda server: DrivePage(server, found, drive), port, allowed, dark=True
    )


class DrivePage:
    """What is on the page now. Controls call it from several threads: a lock keeps the order."""

    def __init__(self, server: "ViserServer", found: FinishedDrive, drive: Drive | None) -> None:
        """Lay the page out, standing at the first frame; without a recording it shows no scans."""
        self.server, self.found, self.drive = server, found, drive
        self.lock = threading.RLock()
        self.boxes = boxes_by_frame(found)
        self.names = tuple(one.name for one in found.vehicles)
        self.places = [found.placed(one) for one in found.vehicles]
        self.chances = [chances_in(found.out / "objects" / name) for name in self.names]
        self.shown: int | None = None
        self.extra: list[Any] = []
        self.closed = False
        self._controls()
        self._scene()
        self.whole()
        self.refresh()

    @property
    def url(self) -> str:
        """Its address."""
        return f"http://{HOST}:{self.server.get_port()}"

    @property
    def frame(self) -> int:
        """The frame shown."""
        return int(self.time.value)

    @property
    def chosen(self) -> int | None:
        """Number of the vehicle chosen."""
        name = self.picker.value
        return None if name == NOTHING else self.names.index(name)

    def play(self) -> None:
        """Go on by a frame, where that is asked for."""
        with self.lock:
            if self.playing.value and self.time.max > 0:
                self.time.value = (self.frame + 1) % (int(self.time.max) + 1)

    def close(self) -> None:
        """Nothing more is sent."""
        with self.lock:
            self.closed = True

    def refresh(self) -> None:
        """Show what the panel asks for."""
        with self.lock:
            if self.closed:
                return
            with self.server.atomic():
                self._show_scan()
                self._show_vehicles()
                for handle in self.ways:
                    handle.visible = self.layers["ways"].value
            self.text.content = self._details()

    def choose(self) -> None:
        """Show the vehicle that is picked, with all its scans, from near; or the whole scene."""
        with self.lock:
            number = self.chosen
            for handle in self.extra:
                handle.remove()
            self.extra = []
            if number is None:
                self.whole()
            else:
                self._show_closely(number)
            self.refresh()

    def whole(self) -> None:
        """The camera over the whole way."""
        way = self.found.T_level_sensor.translation.numpy()
        middle = way.mean(0)
        size = max(40.0, float(np.ptp(way, axis=0).max()))
        aim(self.server, middle, middle + np.array((-0.8, -0.25, 0.75)) * size)

    def _controls(self) -> None:
        gui, last = self.server.gui, len(self.found) - 1
        self.time = gui.add_slider(
            "frame", min=0, max=last, step=1, initial_value=0, disabled=last == 0
        )
        self.playing = gui.add_checkbox("play", initial_value=False)
        self.picker = gui.add_dropdown("vehicle", (NOTHING, *self.names))
        with gui.add_folder("Show"):
            self.layers = {name: gui.add_checkbox(text, True) for name, text in LAYERS.items()}
        self.text = gui.add_html("")
        self.picker.on_update(lambda _: self._pick())
        for control in (self.time, *self.layers.values()):
            control.on_update(lambda _: self.refresh())

    def _pick(self) -> None:
        """`choose`; what has gone since the page was opened is said on it."""
        try:
            self.choose()
        except BadInputError as error:
            self.text.content = f"<div style='padding:.8em'>{escape(str(error))}</div>"

    def _scene(self) -> None:
        """Everything but the scan is sent once, and afterwards only moved, shown and hidden."""
        scene = self.server.scene
        self.sensor: Any = scene.add_frame("/sensor", axes_length=2.0, axes_radius=0.05)
        self.scan: Any = None
        way = self.found.T_level_sensor.translation.numpy() - (0, 0, self.found.ground_m)
        self.ways = [self._line("/way", way, _WHITE)]
        self.nodes = [self._vehicle(number, one) for number, one in enumerate(self.found.vehicles)]

    def _vehicle(self, number: int, one: FoundVehicle) -> dict[str, Any]:
        scene, at, colour = self.server.scene, f"/vehicles/{number}", colour_of(number)
        if one.moving:
            places = self.places[number].translation.numpy()
            self.ways.append(self._line(f"/ways/{number}", places, colour))
        parts: dict[str, Any] = {"place": scene.add_frame(at, show_axes=False)}
        shape = thin(self.found.shape(one), points_a_shape(self.found, _CONFIG))
        parts["shapes"] = self._dots(f"{at}/shape", shape, colour, _SHAPE_DOT_M)
        parts["boxes"] = scene.add_line_segments(
            f"{at}/edges",
            box_segments(Box((0.0, 0.0, 0.0), one.size, (1.0, 0.0, 0.0, 0.0))),
            colour,
            thickness=2.0,
            thickness_units="screen",
        )
        top = (0.0, 0.0, one.size[2] / 2 + 0.5)
        parts["names"] = scene.add_label(f"{at}/name", one.name, position=top)
        body = scene.add_box(f"{at}/body", colour, dimensions=one.size, opacity=0.08)
        body.on_click(lambda _: setattr(self.picker, "value", one.name))
        return {**parts, "body": body}

    def _show_scan(self) -> None:
        self.sensor.wxyz, self.sensor.position = as_node(self.found.T_level_sensor[self.frame])
        if self.drive is not None and self.shown != self.frame:
            points, colours = self._drawn(self.frame)
            self.scan = self._dots("/sensor/scan", points, colours, _DOT_M)
            self.shown = self.frame
        if self.scan is not None:
            self.scan.visible = self.layers["scan"].value

    def _drawn(self, frame: int) -> tuple[Points, np.ndarray]:
        """Points of a scan; those on vehicles have the vehicle's colour, brighter."""
        assert self.drive is not None
        scan, boxes = self.drive.scan(frame), self.boxes.get(frame, {})
        drawn = thinned(frame, scan, boxes, _CONFIG.points_a_scan)
        height = drawn.points @ self.found.T_level_sensor[frame].rotation.numpy()[2]
        height += self.found.ground_m
        grey = (70 + 130 * np.clip(height / 4, 0, 1))[:, None]
        bright = [0.45 * np.array(colour_of(number)) + 140 for number in range(len(self.names))]
        own = np.array([*bright, np.zeros(3)])[drawn.owners]
        return drawn.points, np.where((drawn.owners == NOBODY)[:, None], grey, own).astype(np.uint8)

    def _show_vehicles(self) -> None:
        for number, node in enumerate(self.nodes):
            T = self._place(number)
            node["place"].visible = T is not None
            if T is not None:
                node["place"].wxyz, node["place"].position = as_node(T)
            for name in ("shapes", "boxes", "names"):
                closely = name == "shapes" and number == self.chosen
                node[name].visible = self.layers[name].value and not closely
        for name, handle in zip(("shapes", "scan"), self.extra):
            handle.visible = self.layers[name].value

    def _place(self, number: int) -> SE3 | None:
        """`T_level_box` of a vehicle in the frame shown, if it is there."""
        frames = self.found.vehicles[number].frames
        row = bisect_left(frames, self.frame)
        return self.places[number][row] if self.frame in frames[row : row + 1] else None

    def _show_closely(self, number: int) -> None:
        """All of the vehicle's shape, and what its completed scans measured, at its place."""
        self.found.check_current()
        one = self.found.vehicles[number]
        if self.frame not in one.frames:
            self.time.value = one.fullest
        at = f"/vehicles/{number}"
        shape = self.found.shape(one)
        self.extra = [
            self._dots(f"{at}/whole", shape, colour_of(number), _CHOSEN_DOT_M),
            self._dots(f"{at}/measured", measured(self.found, one), _WHITE, _MEASURED_DOT_M),
        ]
        T = self._place(number)
        assert T is not None
        middle, size = T.translation.numpy(), max(one.size)
        towards = self.found.T_level_sensor[self.frame].translation.numpy() - middle
        towards[2] = 0.6 * np.linalg.norm(towards)
        place = middle + 1.9 * size * towards / max(np.linalg.norm(towards), 1e-6)
        aim(self.server, middle, place)

    def _dots(self, name: str, points: Points, colours: Any, size: float) -> Any:
        cloud = np.ascontiguousarray(points, np.float32)
        return self.server.scene.add_point_cloud(
            name,
            cloud,
            colours,
            point_size=size,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _line(self, name: str, places: np.ndarray, colour: tuple[int, int, int]) -> Any:
        segments = np.stack((places[:-1], places[1:]), axis=1).astype(np.float32)
        if not len(segments):
            segments = np.zeros((1, 2, 3), np.float32)
        scene = self.server.scene
        return scene.add_line_segments(
            name, segments, colour, thickness=2.0, thickness_units="screen"
        )

    def _details(self) -> str:
        """A piece of HTML; every name is escaped."""
        return framed([row(label, escape(value)) for label, value in self._rows()])

    def _rows(self) -> Iterator[tuple[str, str]]:
        found, frame, number = self.found, self.frame, self.chosen
        if found.times:
            yield "time", f"{found.seconds[frame]:.1f} s"
        yield "scan", found.scan_names[frame]
        yield "vehicles", f"{len(self.boxes.get(frame, {}))} here, {len(self.names)} in all"
        if self.drive is None:
            yield "scans", "cannot be read"
        elif found.scanned[frame] and not len(self.scan.points):
            yield "scan", "cannot be read now"
        if number is None:
            yield "shape", "click a vehicle"
            return
        one = found.vehicles[number]
        yield "vehicle", one.name
        yield "box", " x ".join(f"{side:.2f}" for side in one.size) + " m"
        yield "confidence", f"{one.confidence:.2f}"
        for words, chance in self.chances[number].items():
            yield words, f"{chance:.2f}"
        yield (
            "seen",
            f"{'moving' if one.moving else 'standing'}, {counted(len(one.frames), 'frame')}",
        )


def measured(found: FinishedDrive, one: FoundVehicle) -> Points:
    """What a vehicle's completed scans measured, laid over each other in the frame of its box."""
    result = read_result(found.out / "objects" / one.name)
    clouds = [np.empty((0, 3), np.float32)]
    for name in result.scans:
        box = box_of(result.entry(name))
        if box is not None:
            clouds.append(pose_of(box).inverse().apply_numpy(found.scan(one, name)))
    return thin(np.concatenate(clouds), _MEASURED)
