# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The shape that all scans of a track show together: fused, reflected, thinned, without ground."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor

from wildshape.geometry.ground import skirt
from wildshape.geometry.sampling import voxel_thin
from wildshape.records import SensorKind
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.headings import PosedTrack


@dataclass(frozen=True)
class FusionConfig:
    """How the scans of a track become a target shape. Lengths are for vehicles.

    Attributes:
        points: of a target shape.
        sensors: places kept of those from which a track was seen.
        scan_points: of each scan that are fused.
        lidar_voxel_m: cubes over which a LiDAR's points are averaged; their noise is centimetres.
        camera_voxel_m: the same of a camera, whose points are dense and need no mean over so many.
        neighbours: whose mean distance tells strays.
        stray: points whose neighbours lie so many times as far as usual are left out.
    """

    points: int = 2048
    sensors: int = 8
    scan_points: int = 640
    lidar_voxel_m: float = 0.1
    camera_voxel_m: float = 0.05
    neighbours: int = 4
    stray: float = 6.0

    def voxel_m(self, sensor: SensorKind) -> float:
        """Edge of the cubes for that kind of sensor."""
        return self.lidar_voxel_m if sensor == "lidar" else self.camera_voxel_m


def fused_shape(
    sampler: ViewSampler,
    track: PosedTrack,
    config: FusionConfig,
    *,
    mirror: bool,
    voxel_m: float,
) -> Float32[np.ndarray, "G 3"]:
    """A track's scans in the canonical frame, reflected, thinned, without strays and ground.

    Args:
        sampler: gives the scans.
        track: posed.
        config: how they are fused.
        mirror: the object is symmetric in the plane y = 0.
        voxel_m: edge of the cubes, for an object of this size.
    """
    rng = np.random.default_rng(0)
    clouds = []
    for index, scan in enumerate(track.scans):
        points = sampler.store.scan_points(int(scan))
        picked = torch.from_numpy(points[rng.permutation(len(points))[: config.scan_points]])
        clouds.append(track.T_sensor_can[index].inverse().apply(picked).numpy())
    fused = np.concatenate(clouds)
    if mirror:
        fused = np.concatenate((fused, fused * np.asarray((1, -1, 1), np.float32)))
    thinned = voxel_thin(fused, voxel_m)
    kept = thinned[_near_others(thinned, config)]
    kept = kept[~skirt(kept)] if sampler.config.sensor == "lidar" else kept
    return exactly(kept, config.points)


def sensors_of(track: PosedTrack, count: int) -> Float[Tensor, "O 3"]:
    """Where the sensor stood, seen from the object, at times spread over the track."""
    rows = np.linspace(0, len(track.scans) - 1, count).round().astype(int)
    some = track.T_sensor_can[torch.from_numpy(rows)]
    return -(some.rotation.mT @ some.translation[..., None])[..., 0]


def exactly(points: np.ndarray, count: int) -> Float32[np.ndarray, "G 3"]:
    """A seeded choice of so many points, repeated if there are fewer."""
    order = np.random.default_rng(0).permutation(len(points))
    return np.ascontiguousarray(points[order[np.arange(count) % len(points)]], np.float32)


def _near_others(points: Float32[np.ndarray, "n 3"], config: FusionConfig) -> Bool[np.ndarray, "n"]:
    """All but strays. What is merely thin stays: of a roof, seen at a glance, there is no more."""
    from scipy.spatial import KDTree

    apart = KDTree(points).query(points, k=config.neighbours + 1)[0][:, 1:].mean(axis=1)
    return apart <= config.stray * np.median(apart)
