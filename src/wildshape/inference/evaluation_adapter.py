# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A predictor as evaluation wants a method: completions and poses, nothing else."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.free_space import Rays
from wildshape.inference.predictor import BATCH, Predictor
from wildshape.inference.registration import to_middle
from wildshape.records import Completion, Points, Sensor


class _Answer(NamedTuple):
    """What was answered of which scans."""

    scans: list[Points]
    sensor: Sensor
    rays: Rays
    done: list[Completion]

    def is_of(self, scans: Sequence[Points], sensor: Sensor, rays: Rays | None = None) -> bool:
        """Whether these are the scans; `rays`: and these theirs."""
        if rays is not None and list(rays) != list(self.rays):
            return False
        same = len(scans) == len(self.scans) and sensor == self.sensor
        return same and all(map(np.array_equal, scans, self.scans))


@dataclass(frozen=True)
class Learned:
    """Our row in a table. Every method raises BadInputError at fewer than 16 finite points.

    Attributes:
        track: use all scans of a track together; each scan still gets a shape of its own.

    The last answer is kept: the protocol asks for the shapes of scans, then for their poses. With
    rays or without, poses are those of the shapes.
    """

    predictor: Predictor
    track: bool = False
    _last: list["_Answer"] = field(default_factory=list, repr=False, compare=False)

    @property
    def about(self) -> str:
        """What sets this row apart."""
        return "poses and shape from all scans of the track together" if self.track else ""

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """The complete shape `(m, 3)` in the frame of `points` `(n, 3)`, metres."""
        return self.predictor.complete(points, sensor).points

    def complete_many(self, scans: list[Points], sensor: Sensor) -> list[Completion]:
        """Of each scan, in order, shape, confidence and box."""
        return self.complete_sighted(scans, sensor, ())

    def complete_sighted(self, scans: list[Points], sensor: Sensor, rays: Rays) -> list[Completion]:
        """The same, with the rays of the scans' frames."""
        if not (self._last and self._last[0].is_of(scans, sensor, rays)):
            copies = [np.array(scan) for scan in scans]  # a caller may change its own
            done = self._completed(scans, sensor, rays)
            self._last[:] = [_Answer(copies, sensor, tuple(rays), done)]
        return self._last[0].done

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan: takes each scan to the frame of the middle scan."""
        known = [one.done for one in self._last if one.is_of(scans, sensor)]
        done = known[0] if known else self.complete_many(list(scans), sensor)
        return to_middle(stack([one.pose for one in done]))

    def _completed(self, scans: list[Points], sensor: Sensor, rays: Rays) -> list[Completion]:
        if self.track:
            return self.predictor.complete_track(scans, sensor, rays=rays)
        return list(self.predictor.complete_many(scans, sensor, rays=rays))


@dataclass(frozen=True)
class CanonicalShapes:
    """A network's shapes in the frame that it was taught: the paper's oracle (section 5.7).

    Attributes:
        predictor: of a network whose poses were not trained.
    """

    predictor: Predictor

    @property
    def about(self) -> str:
        """What sets this row apart."""
        return "shapes in the object's true frame; no pose is found"

    def complete_canonical(self, scans: list[Points], sensor: Sensor) -> Iterator[Points]:  # noqa: ARG002
        """The complete shape `(m, 3)` of each scan, in its object's frame, metres."""
        for start in range(0, len(scans), BATCH):
            looked = self.predictor.look(scans[start : start + BATCH])
            yield from looked.found.shapes.numpy()
