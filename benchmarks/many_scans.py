# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A data set as large as wanted, made of few simulated scans.

Ray casting a million scans takes ten minutes on two cores and says nothing about the store. So
about 2,000 scans are simulated, thinned to 100 to 200 points each, and copied: every copy of a
track is turned about the sensor by an angle of its own, and its points move by 1 cm of fresh
noise. No two scans are equal, each has a name and a pose of its own, and the store is written by
the same engine as any conversion; only the variety of shapes is that of 80 cars. Truth shapes are
left out, which training never reads and which would fill the disk.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import torch

from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SCANS_A_TRACK = 25
_ORIGINALS = 80
_TRACKS_A_PART = 400
_NOISE_M = 0.01


@dataclass
class ManyScans:
    """A source (see `datasets.source`) of `scans` scans."""

    scans: int
    seed: int = 0
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self) -> list[str]:
        tracks = self.scans // SCANS_A_TRACK
        return [str(start) for start in range(0, tracks, _TRACKS_A_PART)]

    def tracks_of(self, part: str) -> Iterator[Track]:
        last = min(int(part) + _TRACKS_A_PART, self.scans // SCANS_A_TRACK)
        for number in range(int(part), last):
            rng = np.random.default_rng([self.seed, number])
            yield copied(originals(self.seed)[number % _ORIGINALS], number, rng)


@cache
def originals(seed: int) -> list[Track]:
    config = SimulationConfig(tracks=_ORIGINALS, scans=SCANS_A_TRACK, vary_scans=False)
    return list(simulate_tracks(config, seed, workers=1))


def copied(track: Track, number: int, rng: np.random.Generator) -> Track:
    poses = track.T_sensor_object
    assert poses is not None
    turn = rotation_z(torch.tensor(rng.uniform(-np.pi, np.pi), dtype=torch.float64))
    R = turn.numpy().astype(np.float32)
    return Track(
        name=f"{number:06d}",
        scans=tuple(_thinned(scan, rng) @ R.T for scan in track.scans),
        scan_names=tuple(f"{number:06d}-{i:02d}" for i in range(len(track.scans))),
        sensor=track.sensor,
        category=track.category,
        source=f"copy of simulated track {track.name}",
        T_sensor_object=SE3(turn @ poses.rotation, poses.translation @ turn.mT),
    )


def _thinned(scan: Points, rng: np.random.Generator) -> Points:
    count = rng.integers(100, 201)
    points = scan[rng.integers(len(scan), size=count)]
    return points + rng.normal(scale=_NOISE_M, size=points.shape).astype(np.float32)
