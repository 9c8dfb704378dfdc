# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated tracks as records: the same for the same seed, however many workers make them."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wildshape.geometry.se3 import SE3
from wildshape.records import Sensor, Track
from wildshape.simulate.drive import RawTrack, lidar_track
from wildshape.simulate.scan import Returns
from wildshape.simulate.sensor import SENSORS, SpinningLidar
from wildshape.simulate.vehicle import random_vehicle

SensorName = Literal["hdl64", "hdl32", "os1-128", "depth-camera"]
Category = Literal["car", "airplane", "chair"]


@dataclass(frozen=True)
class SimulationConfig:
    """What to simulate.

    Attributes:
        tracks: how many objects.
        scans: usable scans a track; None: 24 for a LiDAR, 5 for the depth camera.
        sensor: what scans.
        category: of our procedural shapes; airplanes and chairs are for the depth camera.
        meshes: folder of the user's meshes instead.
        occlusion: probability that something stands in the way for part of a track.
        ground: leave ground returns within 0.3 m of the object in.
        dropout: share of pulses lost at random.
        noise_m: sigma of the range noise, metres; None: the sensor's own.
        shape_points: points of the complete truth shape.
    """

    tracks: int = 100
    scans: int | None = None
    sensor: SensorName = "hdl64"
    category: Category = "car"
    meshes: Path | None = None
    occlusion: float = 0.3
    ground: bool = False
    dropout: float = 0.03
    noise_m: float | None = None
    shape_points: int = 8192


def simulate_tracks(
    config: SimulationConfig, seed: int, workers: int | None = None
) -> Iterator[Track]:
    """Yield `config.tracks` tracks with truth, in order.

    Track i depends on (seed, i) alone.
    """
    for index in range(config.tracks):
        yield _record(_raw(config, seed, index), config, index)


def _raw(config: SimulationConfig, seed: int, index: int) -> RawTrack:
    rng = np.random.default_rng([seed, index])
    sensor = SENSORS[config.sensor]
    assert isinstance(sensor, SpinningLidar)
    target = random_vehicle(rng).centred()
    noise = sensor.noise_m if config.noise_m is None else config.noise_m
    returns = Returns(noise, config.dropout, float(rng.uniform(0.05, 0.5)), config.ground)
    return lidar_track(target, sensor, config.scans or 24, returns, config.shape_points, rng)


def _record(raw: RawTrack, config: SimulationConfig, index: int) -> Track:
    sensor = SENSORS[config.sensor]
    assert isinstance(sensor, SpinningLidar)
    return Track(
        name=f"{index:06d}",
        scans=tuple(raw.scans),
        scan_names=tuple(f"{i:06d}" for i in range(len(raw.scans))),
        sensor=Sensor("lidar", sensor.resolution_deg),
        category=config.category,
        source=f"simulated {config.sensor} {raw.kind}",
        T_sensor_object=SE3.from_matrix(raw.T_sensor_object),
        shape=raw.shape,
    )
