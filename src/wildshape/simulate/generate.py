# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Simulated tracks as records: the same for the same seed, however many workers make them."""

from collections.abc import Iterator

import numpy as np
import torch

from wildshape.arguments import expect, expect_whole
from wildshape.geometry.transforms.se3 import SE3
from wildshape.parallel.team import Team, team
from wildshape.records import Sensor, Track
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.one_track import Job, RawTrack
from wildshape.simulate.sensor import DepthCamera, SpinningLidar
from wildshape.simulate.shapes.meshes import mesh_files

__all__ = ["SimulationConfig", "simulate_tracks", "simulated_by"]


def simulate_tracks(
    config: SimulationConfig, seed: int, workers: int | None = None
) -> Iterator[Track]:
    """Yield `config.tracks` tracks with truth, in order.

    Track i depends on (config, seed, i) alone: neither on the other tracks nor on `workers`.
    The truth frame of an object has its origin at the centre of its bounding box, x forward,
    y left, z up; poses are T_sensor_object, the shape is in the object frame, metres (depth
    camera: box diagonals).

    Args:
        config: what to simulate.
        seed: at least 0.
        workers: processes; None: one a core.

    Raises:
        BadInputError: a mesh, seed or number of workers that cannot be used.
        MissingExtraError: embreex is not installed.
    """
    expect(config, SimulationConfig, "config")
    expect_whole(seed, "seed")
    with team(workers) as helpers:
        yield from simulated_by(helpers, config, seed)


def simulated_by(helpers: Team, config: SimulationConfig, seed: int) -> Iterator[Track]:
    """The same by helpers that work on other things too: many small sets need no new processes."""
    meshes = mesh_files(config.meshes) if config.meshes else ()
    job = Job(config, seed, meshes)
    for index, made in enumerate(helpers.in_order(job.track, range(config.tracks))):
        yield _record(made, config, index)


def _record(raw: RawTrack, config: SimulationConfig, index: int) -> Track:
    rotation = np.ascontiguousarray(raw.T_object_sensor[:, :3, :3])
    translation = np.ascontiguousarray(raw.T_object_sensor[:, :3, 3])
    return Track(
        name=f"{index:06d}",
        scans=tuple(raw.scans),
        scan_names=tuple(f"{i:06d}" for i in range(len(raw.scans))),
        sensor=_sensor(config.device),
        category=config.shown if config.meshes is None else config.category or "",
        source=f"simulated {config.sensor} {raw.kind}",
        T_sensor_object=SE3(torch.from_numpy(rotation), torch.from_numpy(translation)).inverse(),
        shape=raw.shape,
        rays=raw.rays,
    )


def _sensor(device: SpinningLidar | DepthCamera) -> Sensor:
    if isinstance(device, SpinningLidar):
        return Sensor("lidar", resolution_deg=device.resolution_deg)
    return Sensor("camera", intrinsics=device.intrinsics)
