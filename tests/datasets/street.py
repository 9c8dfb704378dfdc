# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A street with one parked and one moving car, for the writers of data sets' own formats.

Plain 4x4 matrices, so that a test of the readers' frames does not rest on the readers' own classes.
"""

import math
from dataclasses import dataclass

import numpy as np
from tests.cars import car_surface

SIZE = (4.2, 1.7, 1.5)
"""The labelled box of `tests.cars`' car, length width height, metres; its origin is the centre."""


@dataclass(frozen=True)
class Street:
    """Frames of a drive; world frame, metres.

    Attributes:
        T_world_ego: `(4, 4)` a frame, of the vehicle that carries the sensors.
        T_world_object: by object, `(4, 4)` a frame.
        clouds: `(n, 3)` float64 a frame: what the sensor sees.
    """

    T_world_ego: list[np.ndarray]
    T_world_object: dict[str, list[np.ndarray]]
    clouds: list[np.ndarray]


def rigid(x, y, z, yaw=0.0, pitch=0.0, roll=0.0):
    """A rigid transform `(4, 4)`: Rz(yaw) Ry(pitch) Rx(roll), then the translation."""
    (a, b, c), (d, e, f) = ((g(yaw), g(pitch), g(roll)) for g in (math.cos, math.sin))
    T = np.eye(4)
    turn = np.array([[a, -d, 0], [d, a, 0], [0, 0, 1]])
    nod = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    lean = np.array([[1, 0, 0], [0, c, -f], [0, f, c]])
    T[:3, :3] = turn @ nod @ lean
    T[:3, 3] = x, y, z
    return T


def moved(T, points):
    """Points `(n, 3)` carried by a transform."""
    return points @ T[:3, :3].T + T[:3, 3]


def wxyz(T):
    """Quaternion of a rotation less than half a turn, w x y z, w > 0."""
    R = T[:3, :3]
    w = math.sqrt(max(1 + np.trace(R), 1e-12)) / 2
    return w, *(np.array((R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])) / (4 * w))


def faces_seen(T_world_object, eye, points, seed):
    """Surface points `(n, 3)` of a car, world frame, on the faces turned to `eye` `(3,)`."""
    surface, normals = car_surface(points, seed)
    world = moved(T_world_object, surface)
    facing = ((normals @ T_world_object[:3, :3].T) * (eye - world)).sum(axis=1) > 0
    return world[facing]


def street(frames=4, points=2000, at=(1000.0, -500.0, 30.0), eye=(1.3, 0.0, 1.6)):
    """Drive past a parked car while another drives ahead.

    Args:
        frames: how many.
        points: on each car's whole surface, about half of which is seen.
        at: where in the world, metres.
        eye: the sensor's place on the ego vehicle, metres.
    """
    T_world_road = rigid(*at, yaw=0.7)
    ego = [T_world_road @ rigid(2.0 * i, 0, 0, 0.02 * i, 0.01, -0.015) for i in range(frames)]
    things = {
        "parked": [T_world_road @ rigid(11, 5, 0.75, 0.2)] * frames,
        "moving": [T_world_road @ rigid(9 + 1.5 * i, -4, 0.75, -0.1 * i) for i in range(frames)],
    }
    clouds = []
    for i in range(frames):
        place = moved(ego[i], np.array([eye]))[0]
        seen = [faces_seen(T[i], place, points, 7 * i) for T in things.values()]
        ground = np.random.default_rng(i).uniform((-5, -9, 0), (25, 9, 0), (300, 3))
        clouds.append(np.concatenate((*seen, moved(T_world_road, ground))))
    return Street(ego, things, clouds)
