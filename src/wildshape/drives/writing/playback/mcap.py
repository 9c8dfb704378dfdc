# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive as MCAP, in the Foxglove schemas (https://docs.foxglove.dev/docs/sdk/schemas), protobuf.

| topic | schema | frame |
|---|---|---|
| /tf | FrameTransform | world to sensor |
| /scan | PointCloud | sensor |
| /boxes | SceneUpdate: a cube, edges, an arrow and a name a vehicle | world |
| /shapes | PointCloud, coloured: all complete shapes | world |
| /trajectory | PosesInFrame, once: the whole way | world |

`world` is the first frame's sensor frame with z vertical. Every message is whole: a player may jump
anywhere.
"""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.drives.writing.finished import FinishedDrive
from wildshape.drives.writing.playback.moments import (
    SHAPE_POINTS,
    Moment,
    Present,
    moments,
)
from wildshape.errors import load_library
from wildshape.geometry.box import EDGES, SIGNS
from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.rotation import quaternion_from_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import atomic_write
from wildshape.records import Points

WORLD, SENSOR = "world", "sensor"
_INSTALL = "pip install 'wildshape[mcap]'"
_CUBE_ALPHA, _ARROW_M = 0.25, 1.2


def check_mcap() -> None:
    """Refuse before any work what could not be written after it.

    Raises:
        MissingExtraError: a library is not installed.
    """
    for name in ("mcap_protobuf.writer", "foxglove_schemas_protobuf.SceneUpdate_pb2"):
        load_library(name, f"an MCAP recording needs {name.partition('.')[0]}", _INSTALL)


def write_mcap(found: FinishedDrive, path: Path) -> None:
    """Write the recording, atomically; a drive without times is taken to have ten scans a second.

    Raises:
        MissingExtraError: a library is not installed.
    """
    check_mcap()
    from mcap_protobuf.writer import Writer

    zero = max(found.times[0], 0.0) if found.times else 0.0  # its clock knows no time before 0
    shapes = {one.name: thin(found.shape(one), SHAPE_POINTS) for one in found.vehicles}
    with atomic_write(path) as file:
        writer = Writer(file)
        for moment in moments(found):
            message = _Messages(moment, round((zero + moment.seconds) * 1e9))
            if moment.frame == 0:
                _put(writer, "/trajectory", message.way(found.T_level_sensor), message.time_ns)
            for topic, made in message.all(shapes):
                _put(writer, topic, made, message.time_ns)
        writer.finish()


def _put(writer: Any, topic: str, message: Any, time_ns: int) -> None:
    writer.write_message(topic, message, log_time=time_ns, publish_time=time_ns)


@dataclass(frozen=True)
class _Messages:
    """The messages of one frame."""

    moment: Moment
    time_ns: int

    def all(self, shapes: dict[str, Points]) -> list[tuple[str, Any]]:
        now = self.moment
        found = [
            ("/tf", self.transform()),
            ("/boxes", self.boxes()),
            ("/shapes", self.shapes(shapes)),
        ]
        if len(now.scan):
            found.append(("/scan", self.cloud(SENSOR, now.scan)))
        return found

    def transform(self) -> Any:
        T = self.moment.T_level_sensor
        return _new(
            "FrameTransform",
            timestamp=self.stamp(),
            parent_frame_id=WORLD,
            child_frame_id=SENSOR,
            translation=_xyz("Vector3", T.translation.tolist()),
            rotation=_quaternion(T),
        )

    def way(self, T_level_sensor: SE3) -> Any:
        poses = [_pose(T_level_sensor[frame]) for frame in range(len(T_level_sensor))]
        return _new("PosesInFrame", timestamp=self.stamp(), frame_id=WORLD, poses=poses)

    def boxes(self) -> Any:
        all_before = _new("SceneEntityDeletion", timestamp=self.stamp(), type="ALL")
        entities = [self.entity(one) for one in self.moment.present]
        return _new("SceneUpdate", deletions=[all_before], entities=entities)

    def entity(self, one: Present) -> Any:
        size, pose, known = one.vehicle.size, _pose(one.T_level_box), one.vehicle
        colour = _colour(one.colour, 1.0)
        cube = _new(
            "CubePrimitive",
            pose=pose,
            size=_xyz("Vector3", size),
            color=_colour(one.colour, _CUBE_ALPHA),
        )
        corners = SIGNS * np.array(size) / 2
        ends = [_xyz("Point3", corner) for edge in EDGES for corner in corners[list(edge)].tolist()]
        edges = {"type": "LINE_LIST", "thickness": 2.0, "scale_invariant": True, "points": ends}
        ahead = one.T_level_box.apply_numpy(np.array([[size[0] / 2, 0.0, 0.0]]))[0]
        above = one.T_level_box.apply_numpy(np.array([[0.0, 0.0, size[2] / 2 + 0.5]]))[0]
        at = _quaternion(one.T_level_box)
        arrow = {"shaft_length": 0.7 * _ARROW_M, "head_length": 0.3 * _ARROW_M}
        widths = {"shaft_diameter": 0.12, "head_diameter": 0.3}
        return _new(
            "SceneEntity",
            timestamp=self.stamp(),
            frame_id=WORLD,
            id=known.name,
            metadata=[_new("KeyValuePair", key=key, value=text) for key, text in _about(one)],
            cubes=[cube],
            lines=[_new("LinePrimitive", pose=pose, color=colour, **edges)],
            arrows=[
                _new("ArrowPrimitive", pose=_placed(ahead, at), color=colour, **arrow, **widths)
            ],
            texts=[
                _new(
                    "TextPrimitive",
                    pose=_placed(above, at),
                    billboard=True,
                    font_size=14.0,
                    scale_invariant=True,
                    color=colour,
                    text=known.name,
                )
            ],
        )

    def shapes(self, shapes: dict[str, Points]) -> Any:
        present = self.moment.present
        clouds = [one.T_level_box.apply_numpy(shapes[one.vehicle.name]) for one in present]
        colours = [
            np.tile(np.array(one.colour, np.uint8), (len(c), 1)) for one, c in zip(present, clouds)
        ]
        none = np.empty((0, 3), np.float32)
        points = np.concatenate([none, *clouds])
        return self.cloud(WORLD, points, np.concatenate([none.astype(np.uint8), *colours]))

    def cloud(self, frame_id: str, points: Points, colours: np.ndarray | None = None) -> Any:
        """A PointCloud, its points packed: x, y, z, and red, green, blue, alpha."""
        columns = [(name, "<f4") for name in "xyz"]
        if colours is not None:
            columns += [(name, "u1") for name in ("red", "green", "blue", "alpha")]
        rows = np.zeros(len(points), columns)
        for i, name in enumerate("xyz"):
            rows[name] = points[:, i]
        if colours is not None:
            rows["alpha"] = 255
            for i, name in enumerate(("red", "green", "blue")):
                rows[name] = colours[:, i]
        kinds = {"<f4": "FLOAT32", "u1": "UINT8"}
        fields: Any = rows.dtype.fields
        return _new(
            "PointCloud",
            timestamp=self.stamp(),
            frame_id=frame_id,
            pose=_pose(SE3.identity()),
            point_stride=rows.dtype.itemsize,
            fields=[
                _new("PackedElementField", name=name, offset=fields[name][1], type=kinds[kind])
                for name, kind in columns
            ],
            data=rows.tobytes(),
        )

    def stamp(self) -> Any:
        from google.protobuf.timestamp_pb2 import Timestamp

        return Timestamp(seconds=self.time_ns // 10**9, nanos=self.time_ns % 10**9)


def _about(one: Present) -> list[tuple[str, str]]:
    known = one.vehicle
    return [
        ("size", " x ".join(f"{side:.2f}" for side in known.size) + " m"),
        ("confidence", f"{known.confidence:.2f}"),
        ("moving", str(known.moving).lower()),
        *([] if one.speed is None else [("speed", f"{one.speed:.1f} m/s")]),
        ("points", str(one.points)),
    ]


def _new(schema: str, **values: Any) -> Any:
    """A message of the Foxglove schemas."""
    module = import_module(f"foxglove_schemas_protobuf.{schema}_pb2")
    return getattr(module, schema)(**values)


def _pose(T: SE3) -> Any:
    return _placed(T.translation.tolist(), _quaternion(T))


def _placed(position: Any, orientation: Any) -> Any:
    return _new("Pose", position=_xyz("Vector3", position), orientation=orientation)


def _quaternion(T: SE3) -> Any:
    w, x, y, z = quaternion_from_rotation(T.rotation).tolist()
    return _new("Quaternion", x=x, y=y, z=z, w=w)


def _xyz(schema: str, values: Any) -> Any:
    x, y, z = map(float, values)
    return _new(schema, x=x, y=y, z=z)


def _colour(rgb: tuple[int, int, int], alpha: float) -> Any:
    red, green, blue = (part / 255 for part in rgb)
    return _new("Color", r=red, g=green, b=blue, a=alpha)
