# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One simulated LiDAR track as plain arrays; needs numpy and embreex only (worker processes)."""

from dataclasses import dataclass

import numpy as np

from wildshape.errors import BadInputError
from wildshape.simulate.raycast import Scene
from wildshape.simulate.scan import Returns, scan
from wildshape.simulate.sensor import SpinningLidar
from wildshape.simulate.solid import Solid
from wildshape.simulate.trajectory import drive_by
from wildshape.simulate.truth import visible_surface

MIN_POINTS = 100
_ATTEMPTS = 60


@dataclass(frozen=True)
class RawTrack:
    """A track before it becomes a record.

    Attributes:
        scans: `(n_i, 3)` float32, metres, sensor frame.
        T_sensor_object: `(v, 4, 4)` float64.
        shape: `(g, 3)` float32, object frame.
        kind: what the object is.
    """

    scans: list[np.ndarray]
    T_sensor_object: np.ndarray
    shape: np.ndarray
    kind: str


def lidar_track(
    target: Solid,
    sensor: SpinningLidar,
    scans: int,
    returns: Returns,
    shape_points: int,
    rng: np.random.Generator,
) -> RawTrack:
    """Drive past an object until `scans` scans of at least 100 points are together.

    Args:
        target: the object, box centre at the origin of its frame, metres.
        sensor: what scans.
        scans: how many usable scans.
        returns: how pulses are lost.
        shape_points: points of the complete shape.
        rng: the only source of chance.

    Raises:
        BadInputError: no drive-by shows enough of the object.
    """  # fmt: skip
    scene = Scene([target])
    shape = visible_surface(target, scene, shape_points, -5.0, rng)
    half_height = float(target.bounds[1, 2])
    height = sensor.height_m + rng.normal(0.0, 0.03)
    for attempt in range(_ATTEMPTS):
        far = 30.0 * 0.96**attempt
        drive = drive_by(height, half_height, 4.0, max(far, 8.0), rng)
        usable = _drive_scans(scene, target, sensor, drive.T_object_sensor, scans, returns, rng)
        if usable is not None:
            clouds, T_object_sensor = usable
            return RawTrack(clouds, np.linalg.inv(T_object_sensor), shape, target.kind)
    raise BadInputError(
        f"the object {target.kind or 'given'} gives no {scans} scans of >= {MIN_POINTS} points to "
        f"{sensor.name} within 30 m: it is too small, not in metres, or ask for fewer scans."
    )


def _drive_scans(
    scene: Scene,
    target: Solid,
    sensor: SpinningLidar,
    poses: np.ndarray,
    count: int,
    returns: Returns,
    rng: np.random.Generator,
) -> tuple[list[np.ndarray], np.ndarray] | None:
    """The first `count` usable scans from a random place of the drive on, or None."""  # fmt: skip
    if len(poses) < count:
        return None
    start = int(rng.integers(0, len(poses) - count + 1))
    clouds: list[np.ndarray] = []
    used: list[int] = []
    for i in range(start, len(poses)):
        if len(clouds) + len(poses) - i < count:
            return None
        points = scan(scene, target, sensor, poses[i], returns, rng)
        if len(points) >= MIN_POINTS:
            clouds.append(points)
            used.append(i)
        if len(clouds) == count:
            return clouds, poses[used]
    return None
