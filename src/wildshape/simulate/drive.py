# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One simulated track as plain arrays: a LiDAR driven past, or a depth camera set around."""

from dataclasses import dataclass

import numpy as np

from wildshape.errors import BadInputError
from wildshape.simulate.occluder import occluders
from wildshape.simulate.raycast import Scene
from wildshape.simulate.scan import Returns, scan
from wildshape.simulate.sensor import DepthCamera, SpinningLidar
from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.trajectory import drive_by
from wildshape.simulate.truth import visible_surface
from wildshape.simulate.view import view

MIN_POINTS = 100
_ATTEMPTS = 60
_NEAR_M, _FAR_M = 4.0, 30.0
_WHOLE_PASS = 2 / 3


@dataclass(frozen=True)
class RawTrack:
    """A track before it becomes a record.

    Attributes:
        scans: `(n_i, 3)` float32, metres, sensor frame.
        T_object_sensor: `(v, 4, 4)` float64.
        shape: `(g, 3)` float32, object frame.
        kind: what the object is.
    """

    scans: list[np.ndarray]
    T_object_sensor: np.ndarray
    shape: np.ndarray
    kind: str


@dataclass(frozen=True)
class Passing:
    """What is wanted of one track.

    Attributes:
        sensor: what scans.
        scans: how many usable scans, each with at least 100 points on the object.
        returns: how pulses are lost.
        occluded: whether things stand in the way.
        shape_points: points of the complete shape.
    """

    sensor: SpinningLidar
    scans: int
    returns: Returns
    occluded: bool
    shape_points: int


def lidar_track(target: Solid, wanted: Passing, rng: np.random.Generator) -> RawTrack:
    """Drive past an object, again if need be, until enough usable scans are together.

    The truth shape is what can be seen from a point's own height or higher: a LiDAR on a road
    sees every wall down to the ground, but no car's underside.

    Args:
        target: the object, box centre at the origin of its frame, metres.
        wanted: the sensor and the number of scans.
        rng: the only source of chance.

    Raises:
        BadInputError: no drive-by shows enough of the object.
    """
    alone = Scene([target])
    shape = visible_surface(target, alone, wanted.shape_points, 0.0, rng)
    height = wanted.sensor.height_m + rng.normal(0.0, 0.03)
    for attempt in range(_ATTEMPTS):
        far = max(_FAR_M * 0.96**attempt, 2 * _NEAR_M)
        drive = drive_by(height, target.bounds[1], _NEAR_M, far, rng)
        usable = _drive(target, alone, wanted, drive.T_object_sensor, rng)
        if usable is not None:
            clouds, poses = usable
            return RawTrack(clouds, poses, shape, target.kind)
    raise BadInputError(
        f"the object {target.kind or 'given'} gives no {wanted.scans} scans of >= {MIN_POINTS} "
        f"points to {wanted.sensor.name} within {_FAR_M:g} m: it is too small, not in metres, or "
        "ask for fewer scans."
    )


def _drive(
    target: Solid, alone: Scene, wanted: Passing, poses: np.ndarray, rng: np.random.Generator
) -> tuple[list[np.ndarray], np.ndarray] | None:
    """Usable scans of a random stretch of the drive; None if they are too few.

    Two tracks in three are spread over as much of the pass as there is, every k-th scan; the
    third is every scan of a short stretch, as a sensor that loses its object early leaves it.
    """
    longest = len(poses) // wanted.scans
    if longest == 0:
        return None
    stride = longest if rng.random() < _WHOLE_PASS else 1
    spare = len(poses) - stride * wanted.scans
    poses = poses[int(rng.integers(0, spare + 1)) :: stride]
    scene = alone
    if wanted.occluded:
        in_the_way = occluders(target, poses[: wanted.scans, :3, 3], rng)
        scene = Scene([target, *in_the_way])
    clouds: list[np.ndarray] = []
    used: list[int] = []
    for i, T_object_sensor in enumerate(poses):
        if len(clouds) + len(poses) - i < wanted.scans:
            return None
        points, on_target = scan(scene, target, wanted.sensor, T_object_sensor, wanted.returns, rng)
        if on_target >= MIN_POINTS:
            clouds.append(points)
            used.append(i)
        if len(clouds) == wanted.scans:
            return clouds, poses[used]
    return None


def camera_track(
    target: Solid, camera: DepthCamera, scans: int, returns: Returns, shape_points: int,
    rng: np.random.Generator,
) -> RawTrack:  # fmt: skip
    """Depth views from random sides; the truth shape is what is seen from anywhere.

    Args:
        target: the object, box centre at the origin, box diagonal 1.
        camera: what looks.
        scans: how many views.
        returns: noise and dropout (the rest is a LiDAR's).
        shape_points: points of the complete shape.
        rng: the only source of chance.

    Raises:
        BadInputError: hardly anything of the object is seen.
    """
    scene = Scene([target])
    shape = visible_surface(target, scene, shape_points, -90.0, rng)
    clouds: list[np.ndarray] = []
    poses: list[np.ndarray] = []
    for _ in range(scans + _ATTEMPTS):
        points, T_object_camera = view(scene, camera, returns.noise_m, returns.dropout, rng)
        if len(points) >= MIN_POINTS:
            clouds.append(points)
            poses.append(T_object_camera)
        if len(clouds) == scans:
            return RawTrack(clouds, np.stack(poses), shape, target.kind)
    raise BadInputError(
        f"the object {target.kind or 'given'} shows fewer than {MIN_POINTS} points a view: it is "
        "too thin; check the mesh."
    )
