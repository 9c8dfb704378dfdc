# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Full scans of a small street by ray casting: parked cars, one that moves, walls and poles."""

import math
from dataclasses import dataclass, replace

import numpy as np

from wildshape.simulate.raycast import Scene
from wildshape.simulate.sensor import HDL64
from wildshape.simulate.shapes.solid import Solid, box, cylinder
from wildshape.simulate.shapes.vehicle import vehicle

HEIGHT = 1.7
STEP_DEG = 0.3


@dataclass(frozen=True)
class Street:
    """A drive with its truth; the world is the first frame's sensor frame.

    Attributes:
        scans: `(n, 3)` float32 a frame, sensor frame.
        places: `(frames, 2)` of the sensor.
        cars: by name, `(frames, 3)` middle x, y of the footprint and yaw.
        sizes: by name, length, width, height.
    """

    scans: list[np.ndarray]
    places: np.ndarray
    cars: dict[str, np.ndarray]
    sizes: dict[str, np.ndarray]


def moved(body, x, y, yaw):
    """A solid turned and put on the road."""
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return replace(body, vertices=body.vertices @ turn.T + (x, y, -HEIGHT))


def things():
    """What does not move: road, house fronts, poles."""
    road = box((-80.0, -80.0, -HEIGHT - 0.5), (120.0, 80.0, -HEIGHT))
    rng = np.random.default_rng(5)
    walls = []
    for x in np.arange(-50.0, 90.0, 9.0).tolist():
        left, right = rng.uniform(12.0, 17.0, 2).tolist()
        walls.append(box((x, left, -HEIGHT), (x + 7.0, left + 6.0, 5.0)))
        walls.append(box((x, -right - 6.0, -HEIGHT), (x + 7.0, -right, 5.0)))
    poles = [
        cylinder(np.array((x, 6.5, -HEIGHT)), np.array((x, 6.5, 3.0)), (0.12, 0.12), 12)
        for x in (-18.0, -8.0, -3.0, 5.0, 10.0, 19.0, 28.0)
    ]
    return [road, *walls, *poles]


def street(frames=10, speed=0.7):
    """Drive past parked cars while another comes the other way."""
    rng = np.random.default_rng(3)
    bodies = {
        name: vehicle(kind, rng)
        for name, kind in zip(
            ("near", "left", "far", "moving"), ("sedan", "hatchback", "van", "sedan")
        )
    }
    at = np.arange(frames)
    ones = np.ones(frames)
    cars = {
        "near": np.column_stack((9 * ones, -4 * ones, 0.05 * ones)),
        "left": np.column_stack((14 * ones, 4.5 * ones, (math.pi - 0.04) * ones)),
        "far": np.column_stack((20 * ones, -4.2 * ones, -0.03 * ones)),
        "moving": np.column_stack((26 - 0.9 * at, 1.5 * ones, math.pi * ones)),
    }
    places = np.column_stack((speed * at, 0.02 * at))
    scans = []
    for frame in range(frames):
        placed = [moved(bodies[name], *way[frame]) for name, way in cars.items()]
        scans.append(scan([*things(), *placed], places[frame], frame))
    sizes = {name: np.ptp(body.vertices, axis=0) for name, body in bodies.items()}
    return Street(scans, places, cars, sizes)


def scan(solids: list[Solid], place, seed, beams_deg=HDL64.elevation_deg):
    """One turn of the sensor."""
    up = np.deg2rad(np.asarray(beams_deg))
    around = np.deg2rad(np.arange(0, 360, STEP_DEG))
    e, a = (grid.ravel() for grid in np.meshgrid(up, around, indexing="ij"))
    rays = np.column_stack((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))
    origins = np.broadcast_to((*place, 0.0), rays.shape)
    away = Scene(solids).cast(origins, rays).distance
    hit = away < 80.0
    noise = np.random.default_rng(seed).normal(scale=0.01, size=len(away))
    return (rays[hit] * (away + noise)[hit, None]).astype(np.float32)


def write_scans(folder, scans):
    """As a folder of full scans, ten a second."""
    folder.mkdir(parents=True)
    for frame, scan in enumerate(scans):
        np.save(folder / f"{frame:06d}.npy", scan)
    (folder / "times.txt").write_text("".join(f"{0.1 * i:.1f}\n" for i in range(len(scans))))
