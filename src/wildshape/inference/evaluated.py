# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A predictor as evaluation wants a method: clouds and poses, nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass

from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.predictor import Predictor
from wildshape.inference.registration import to_middle
from wildshape.records import Completion, Points, Sensor


@dataclass(frozen=True)
class Learned:
    """Our row in a table.

    Attributes:
        predictor: does the work; each scan is completed on its own.
    """

    predictor: Predictor

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """The complete shape `(m, 3)` in the frame of `points` `(n, 3)`, metres.

        Raises:
            BadInputError: fewer than 16 finite points.
        """
        return self.predictor.complete(points, sensor).points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Completion]:
        """Of each scan, in order, shape, confidence and box; in batches.

        Raises:
            BadInputError: one of them has fewer than 16 finite points.
        """
        return list(self.predictor.complete_many(scans, sensor))

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan: takes each scan to the frame of the middle scan.

        Raises:
            BadInputError: a scan has fewer than 16 finite points.
        """
        return self.predictor.register_track(scans, sensor)


@dataclass(frozen=True)
class LearnedTrack:
    """Our row that uses all scans of a track together; each scan still gets a shape of its own.

    Attributes:
        predictor: does the work.
    """

    predictor: Predictor

    @property
    def about(self) -> str:
        """What sets this row apart."""
        return "poses and shape from all scans of the track together"

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """One scan is a track of one.

        Raises:
            BadInputError: fewer than 16 finite points.
        """
        return self.predictor.complete(points, sensor).points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Completion]:
        """The track's shape in the frame of each of its scans, confidence and box.

        Raises:
            BadInputError: one of them has fewer than 16 finite points.
        """
        return self.predictor.complete_track(scans, sensor)

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan.

        Raises:
            BadInputError: a scan has fewer than 16 finite points.
        """
        return to_middle(stack([done.pose for done in self.complete_many(list(scans), sensor)]))
