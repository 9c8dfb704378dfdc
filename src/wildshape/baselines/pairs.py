# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From pairs of neighbouring scans to a whole track: how every ICP baseline works (METHOD 9)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float

from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.registration import fuse_scans
from wildshape.records import Points, Sensor

Cloud = Float[np.ndarray, "_ 3"]
Solve = Callable[[Cloud, Cloud], SE3]


@runtime_checkable
class Pair(Protocol):
    """Registers a pair of scans."""

    @property
    def about(self) -> str:
        """The method, its engine and its settings in a line."""
        ...

    def align(self, source: Points, target: Points, sensor: Sensor) -> SE3:
        """`T_target_source`."""
        ...


@dataclass(frozen=True)
class Chained:
    """A method of pairs, chained over the neighbours of a track to its middle scan."""

    pair: Pair

    @property
    def about(self) -> str:
        """The method and its settings in a line."""
        return self.pair.about

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan."""
        return chain(scans, partial(self.pair.align, sensor=sensor))

    def complete_track(self, scans: Sequence[Points], sensor: Sensor) -> Points:
        """The fused scans, `(m, 3)` in the middle scan's frame."""
        return fuse_scans(scans, self.register_track(scans, sensor))


def chain(scans: Sequence[Points], align: Callable[[Points, Points], SE3]) -> SE3:
    """`T_middle_scan`, one a scan: pairs of neighbours, multiplied up to the middle scan.

    Args:
        scans: in time order.
        align: `T_target_source` of a source and a target scan.
    """
    middle = len(scans) // 2
    chained: dict[int, SE3] = {middle: SE3.identity()}
    for i in range(middle - 1, -1, -1):
        chained[i] = chained[i + 1] @ align(scans[i], scans[i + 1])
    for i in range(middle + 1, len(scans)):
        chained[i] = chained[i - 1] @ align(scans[i], scans[i - 1])
    return stack([chained[i] for i in range(len(scans))])


def about_centroids(source: Points, target: Points, solve: Solve) -> SE3:
    """`T_target_source` from a solver to which "no motion" means aligned centroids."""
    return _about(source, target, centroid(source), centroid(target), solve)


def from_here(source: Points, target: Points, solve: Solve) -> SE3:
    """`T_target_source` from a solver to which "no motion" means none."""
    return _about(source, target, centroid(target), centroid(target), solve)


def _about(
    source: Points,
    target: Points,
    source_centre: Float[np.ndarray, "3"],
    target_centre: Float[np.ndarray, "3"],
    solve: Solve,
) -> SE3:
    """Solved near the origin and in float64, where a turn moves no point far."""
    T = solve(source - source_centre, target - target_centre)
    shift = torch.as_tensor(target_centre) - T.rotation @ torch.as_tensor(source_centre)
    return SE3(T.rotation, T.translation + shift)


def centroid(points: Points) -> Float[np.ndarray, "3"]:
    """The mean, in float64."""
    return points.mean(axis=0, dtype=float)
