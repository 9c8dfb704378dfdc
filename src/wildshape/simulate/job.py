# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track number i of a simulation, from (seed, i) alone; numpy only, so that workers start fast."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.drive import Passing, RawTrack, camera_track, lidar_track
from wildshape.simulate.scan import Returns
from wildshape.simulate.sensor import DepthCamera
from wildshape.simulate.shapes.meshes import read_mesh
from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.shapes.unit_shapes import airplane, chair
from wildshape.simulate.shapes.vehicle import random_vehicle


@dataclass(frozen=True)
class Job:
    """A whole simulation.

    Attributes:
        config: what is wanted.
        seed: of all chance.
        meshes: the user's files, or empty for our own shapes.
    """

    config: SimulationConfig
    seed: int
    meshes: tuple[Path, ...]

    def track(self, index: int) -> RawTrack:
        """Simulate one track.

        Raises:
            BadInputError: a mesh that cannot be used.
        """
        config = self.config
        rng = np.random.default_rng([self.seed, index])
        target = self._target(index, rng)
        scans = config.usual_scans
        if config.vary_scans:
            scans = int(rng.integers(max(scans // 2, 1), scans * 5 // 3 + 1))
        glass = float(rng.uniform(0.02, 0.3))
        returns = Returns(config.noise, config.loss, glass, config.ground)
        if isinstance(config.device, DepthCamera):
            return camera_track(target, config.device, scans, returns, config.shape_points, rng)
        occluded = bool(rng.random() < config.occlusion)
        wanted = Passing(config.device, scans, returns, occluded, config.shape_points)
        return lidar_track(target, wanted, rng)

    def _target(self, index: int, rng: np.random.Generator) -> Solid:
        lidar = self.config.is_lidar
        if self.meshes:
            return read_mesh(self.meshes[index % len(self.meshes)], metres=lidar)
        makers = {"car": random_vehicle, "airplane": airplane, "chair": chair}
        return makers[self.config.category](rng).centred(None if lidar else 1.0)
