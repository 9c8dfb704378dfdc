# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One turn brings shapes of any canonical frame to the true one, although some poses are wrong."""

import math

import numpy as np
import torch
from tests.cars import drive_by, poses_of
from tests.strategies import rotation_about

from wildshape.baselines.dpc.completer import Dpc
from wildshape.baselines.dpc.pre_aligned import pre_aligned
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Track

R_CANONICAL_OBJECT = rotation_about((1, 2, 3), 0.8).double()


class Turned(Dpc):
    """Knows all shapes, in a frame of its own; takes front for rear in every third track."""

    tracks: list[Track]

    def __init__(self, tracks):
        object.__setattr__(self, "tracks", tracks)

    def canonical(self, points, sensor):
        found = [
            (number, track, i)
            for number, track in enumerate(self.tracks)
            for i, scan in enumerate(track.scans)
            if np.array_equal(scan, points)
        ]
        number, track, i = found[0]
        half = rotation_z(torch.tensor(math.pi if number % 3 == 0 else 0.0).double())
        R = poses_of(track).rotation[i] @ half @ R_CANONICAL_OBJECT.mT
        cloud = np.asarray(track.shape) @ R_CANONICAL_OBJECT.float().numpy().T
        return cloud, SE3(R, torch.zeros(3).double())


def test_shapes_are_aligned_by_the_truth_of_others():
    tracks = [drive_by(f"t{seed}", scans=3, points=60, seed=seed) for seed in range(5)]
    method = Turned(tracks)
    found = pre_aligned(method, tracks[:4])
    np.testing.assert_allclose(found.R_object_canonical, R_CANONICAL_OBJECT.T, atol=1e-6)
    (shape,) = found.complete_canonical([tracks[4].scans[0]], tracks[4].sensor)
    np.testing.assert_allclose(shape, np.asarray(tracks[4].shape), atol=1e-5)
