# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The validation set `val-occluded`: simulated scans of which 30 to 60 % of the rays are blocked.

`python -m experiments.val_occluded --out val-occluded` writes a packed store with rays. Drives past
cars behind poles, boxes and other cars are simulated; of each track the scans are kept of which
so many of the rays through the object ended before it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from wildshape.cli.main import in_a_sentence
from wildshape.geometry.projection.full_scan import MOST_RAYS, thinned
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.io.write_tracks import write_tracks
from wildshape.records import Points, Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SEED, DRIVES, LEAST_SCANS = 9101, 300, 4
BLOCKED = (0.3, 0.6)
_THROUGH_M, _BEFORE_M, _ALL = 0.06, 0.3, 1_000_000
_AROUND = 8


def blocked_share(scan: Points, rays: SightLines, shape: Points) -> float:
    """Of the rays that would meet an object, the share that ended before it.

    Args:
        scan: its returns, sensor frame, metres.
        rays: all others around it.
        shape: points of its surface, sensor frame, 5 cm apart.
    """
    from scipy.spatial import KDTree

    away = np.linalg.norm(shape, axis=1)
    every = SightLines.joined((SightLines.of_returns(scan), rays))
    apart, near = KDTree(shape / away[:, None]).query(every.directions, k=_AROUND)
    depth = away[near].min(1)
    through = apart[:, 0] * depth < _THROUGH_M
    blocked = every.ranges < depth - _BEFORE_M
    return float((through & blocked).sum() / max(through.sum(), 1))


def occluded_tracks(drives: int, seed: int = SEED) -> Iterator[Track]:
    """The tracks of the set, of so many drives."""
    config = SimulationConfig(tracks=drives, occlusion=0.999, far_m=25.0, rays=_ALL)
    for track in simulate_tracks(config, seed):
        kept = [i for i in range(len(track.scans)) if BLOCKED[0] <= _share(track, i) <= BLOCKED[1]]
        if len(kept) >= LEAST_SCANS:
            part = track.part(kept)
            yield replace(part, rays=tuple(_fewer(rays) for rays in part.rays))


def _share(track: Track, i: int) -> float:
    assert track.T_sensor_object is not None
    assert track.shape is not None
    rays = track.rays[i]
    if rays is None:
        return 0.0
    return blocked_share(track.scans[i], rays, track.T_sensor_object[i].apply_numpy(track.shape))


def _fewer(rays: SightLines | None) -> SightLines | None:
    return rays and rays.part(thinned(np.arange(len(rays)), MOST_RAYS))


def main() -> None:
    """Write the set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--drives", type=int, default=DRIVES)
    parser.add_argument("--seed", type=int, default=SEED, help="of another set like it")
    asked = parser.parse_args()
    settings = {"seed": asked.seed, "drives": asked.drives, "blocked": BLOCKED}
    tracks = occluded_tracks(asked.drives, asked.seed)
    command = "experiments.val_occluded"
    print(write_tracks(tracks, asked.out, "packed", command=command, settings=settings))


if __name__ == "__main__":
    with in_a_sentence():
        main()
