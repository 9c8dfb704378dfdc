# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An object made ready to be drawn: upright, thinned, with bounds, box edges and sensor arrow.

Drawing frame: z up. A LiDAR frame is one already; a camera frame (x right, y down, z forward)
becomes (x, z, -y). Metres throughout; the page and the README's picture draw the same scene.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from wildshape.geometry.box import EDGES
from wildshape.geometry.sampling import thin
from wildshape.records import Box, SensorKind
from wildshape.report.content import Cloud, ReportObject

MAX_POINTS = 4096
_MARGIN = 0.06
_GAP, _ARROW = 0.06, 0.2  # of the object's extent: before the arrow, and its length

Segments = Float[np.ndarray, "e 2 3"]


@dataclass(frozen=True)
class Scene:
    """What one row of panels shows.

    Attributes:
        clouds: thinned, in the drawing frame.
        middle: `(3,)` of everything but the arrow; the camera turns about it.
        extent: longest side of its bounds, metres.
        low: `(3,)` lower corner of the space shown in every panel.
        high: `(3,)` its upper corner.
        box: `(e, 2, 3)` segments of the box and of its heading mark; e = 0 without a box.
        arrow: `(2, 3)` from beside the object towards the sensor; None if the sensor is inside.
        distance: from the sensor to the object's middle, metres.
    """

    clouds: tuple[Cloud, ...]
    middle: Float[np.ndarray, "3"]
    extent: float
    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    box: Segments
    arrow: Float[np.ndarray, "2 3"] | None
    distance: float


def scene_of(shown: ReportObject) -> Scene:
    """Prepare an object; points that are not finite are left out."""
    clouds = tuple(_prepared(cloud, shown.sensor) for cloud in shown.clouds)
    box = box_segments(shown.box, shown.sensor)
    low, high = _bounds(clouds, box)
    middle, extent = (low + high) / 2, float((high - low).max())
    arrow = _arrow(clouds, middle, extent) if len(clouds) else None
    if arrow is not None:
        low, high = np.minimum(low, arrow.min(0)), np.maximum(high, arrow.max(0))
    margin = _MARGIN * extent
    distance = float(np.linalg.norm(middle))
    return Scene(clouds, middle, extent, low - margin, high + margin, box, arrow, distance)


def upright(points: np.ndarray, sensor: SensorKind) -> np.ndarray:
    """From the sensor frame to the drawing frame, any shape `(..., 3)`."""
    if sensor == "lidar":
        return points
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack((x, z, -y), axis=-1)


TRUTH_POINTS = 8192


def box_segments(box: Box | None, sensor: SensorKind = "lidar") -> Segments:
    """The twelve edges of a box and a mark from its front face forward, drawing frame."""
    if box is None:
        return np.zeros((0, 2, 3), np.float32)
    corners, centre = box.corners, np.asarray(box.centre)
    ahead = corners[4] - corners[0]
    front = centre + np.outer((0.5, 0.62), ahead)
    ends = np.concatenate((corners[np.array(EDGES)], front[None]))
    return upright(ends, sensor).astype(np.float32)


def _prepared(cloud: Cloud, sensor: SensorKind) -> Cloud:
    finite = cloud.points[np.isfinite(cloud.points).all(axis=1)]
    points = np.ascontiguousarray(upright(thin(finite, MAX_POINTS), sensor), dtype=np.float32)
    return Cloud(cloud.label, points, cloud.paint, cloud.size)


def _bounds(clouds: tuple[Cloud, ...], box: Segments) -> tuple[np.ndarray, np.ndarray]:
    everything = np.concatenate([c.points for c in clouds] + [box.reshape(-1, 3)])
    if not len(everything):
        everything = np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])
    low, high = everything.min(0).astype(np.float64), everything.max(0).astype(np.float64)
    short = np.maximum(1e-3, 0.05 * (high - low).max()) - (high - low)
    grow = np.maximum(short, 0) / 2  # a flat or single-point cloud still spans a space
    return low - grow, high + grow


def _arrow(clouds: tuple[Cloud, ...], middle: np.ndarray, extent: float) -> np.ndarray | None:
    distance = float(np.linalg.norm(middle))
    if distance < extent * (0.5 + _GAP + _ARROW):
        return None
    towards = -middle / distance
    points = np.concatenate([c.points for c in clouds])
    reach = float(np.max((points - middle) @ towards, initial=0.0)) + _GAP * extent
    return middle + np.outer((reach, reach + _ARROW * extent), towards)
