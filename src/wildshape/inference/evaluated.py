# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A predictor as evaluation wants a method: completions and poses, nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import Predictor
from wildshape.records import Completion, Points, Sensor


@dataclass(frozen=True)
class Learned:
    """Our row in a table. Every method raises BadInputError at fewer than 16 finite points.

    Attributes:
        predictor: does the work.
        track: use all scans of a track together; each scan still gets a shape of its own.
    """

    predictor: Predictor
    track: bool = False

    @property
    def about(self) -> str:
        """What sets this row apart."""
        return "poses and shape from all scans of the track together" if self.track else ""

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """The complete shape `(m, 3)` in the frame of `points` `(n, 3)`, metres."""
        return self.predictor.complete(points, sensor).points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Completion]:
        """Of each scan, in order, shape, confidence and box."""
        if self.track:
            return self.predictor.complete_track(scans, sensor)
        return list(self.predictor.complete_many(scans, sensor))

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan: takes each scan to the frame of the middle scan."""
        return self.predictor.register_track(scans, sensor, track=self.track)
