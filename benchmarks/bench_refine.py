# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Refinement of a batch beside its plain twin, and clusters by our kernel beside k-d trees.

    python benchmarks/bench_refine.py            # a minute
    python benchmarks/bench_refine.py --small    # half a minute

Both refine the answers of the shipped weights to simulated scans; times are of one scan. Clusters
are of 16,000 points, as of a scan of HDL-64E above the ground. Both sides use one thread.
"""

from functools import partial

import numpy as np
import torch
from machine import header
from outcome import Outcome
from plain_refine import refine as refine_plainly
from turns import begin, options, take_turns

from wildshape.geometry.sampling import sorted_points
from wildshape.inference.predictor import load
from wildshape.inference.refine import Refined, refine
from wildshape.ops.connected import connected_parts, connected_trees
from wildshape.records import Points
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

FASTER, CLUSTERS_FASTER, APART_M = 1.5, 2.0, 1e-3


def answers(scans: list[Points]) -> tuple[torch.Tensor, ...]:
    """Shapes, rotations and translations of the unrefined network."""
    predictor = load(raw=True)
    done = list(predictor.complete_many(scans))
    R = torch.stack([one.pose.rotation for one in done])
    t = torch.stack([one.pose.translation for one in done])
    own = (one.pose.inverse().apply_numpy(one.points) for one in done)
    half = torch.from_numpy(np.stack(list(own)))[:, : done[0].points.shape[0] // 2]
    return torch.cat((half, half * half.new_tensor((1.0, -1.0, 1.0))), dim=1), R, t


def plainly(scans: list[Points], shapes, R, t) -> list:
    given = zip(scans, shapes.numpy(), R.numpy(), t.numpy())
    return [refine_plainly(*one, mirror=True) for one in given]


def measure_refinement(outcome: Outcome, count: int, seconds: float) -> None:
    tracks = simulate_tracks(SimulationConfig(tracks=4), seed=0, workers=1)
    scans = [sorted_points(scan) for track in tracks for scan in track.scans][:count]
    given = (scans, *answers(scans))
    works = {"batch": partial(refine, *given, mirror=True), "plain": partial(plainly, *given)}
    times = take_turns(works, seconds, at_least=3)
    case = f"refinement, each of {len(scans)} scans"
    outcome.add(case, {name: [ms / len(scans) for ms in found] for name, found in times.items()})
    outcome.at_least(case, "batch", "plain", FASTER)
    together, one_by_one = works["batch"](), works["plain"]()
    assert isinstance(together, Refined)
    apart = np.abs(together.translation.numpy() - np.stack([one.translation for one in one_by_one]))
    outcome.bar("refinement: places apart from the twin's, m", float(apart.max()), APART_M)


def measure_clusters(outcome: Outcome, seconds: float) -> None:
    rng = np.random.default_rng(0)
    middles = rng.normal(size=(400, 1, 3)) * (10.0, 10.0, 0.6)
    points = (middles + rng.normal(scale=0.8, size=(400, 40, 3))).reshape(-1, 3).astype(np.float32)
    works = {"ours": partial(connected_parts, points, 1.0, 0.25)}
    works["trees"] = partial(connected_trees, points, 1.0, 0.25)
    case = f"clusters of {len(points)} points"
    outcome.add(case, take_turns(works, seconds))
    outcome.at_least(case, "ours", "trees", CLUSTERS_FASTER)


def main() -> None:
    arguments = begin(options(__doc__))
    torch.set_num_threads(1)
    print(header("bench_refine.py"))
    outcome = Outcome("refine")
    seconds = 1.5 if arguments.small else 10.0
    measure_refinement(outcome, 4 if arguments.smoke else 32, seconds)
    measure_clusters(outcome, seconds)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
