# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The baselines' settings, searched on simulated validation drives that no result is measured on.

    python experiments/search_baselines.py [--tracks 8] [--out benchmarks/results/baselines.json]

The least mean rotation error, each cut at 30 degrees, wins: methods that need a start on scans as
recorded, those that need none on scans turned in yaw. Where Open3D is installed it is searched too.
"""

import argparse
import itertools
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.baselines.fast_global import FastGlobal
from wildshape.baselines.global_icp import GlobalIcp
from wildshape.baselines.icp import Gicp, LocalIcp, MultiStartIcp
from wildshape.baselines.kiss_matcher import KissMatcher
from wildshape.baselines.pairs import Chained
from wildshape.cli.main import in_a_sentence
from wildshape.errors import MissingExtraError
from wildshape.evaluation.metrics import ACCURATE_DEG
from wildshape.evaluation.protocol import run
from wildshape.evaluation.results import Rotate
from wildshape.evaluation.summary import figures_of
from wildshape.io.atomic import write_json
from wildshape.io.output import provenance
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

SEED, SCANS = 7001, 16
DISTANCES, VOXELS = (0.05, 0.1, 0.175, 0.3, 0.5), (0.075, 0.1, 0.125, 0.2)


@dataclass(frozen=True)
class RegistersOnly:
    """A baseline without its fused cloud, which the search does not score."""

    register_track: Callable[..., Any]


@dataclass(frozen=True)
class Search:
    """One baseline of pairs: how it is made, what is tried, and under which protocol."""

    make: Callable[..., Any]
    grid: dict[str, tuple[float, ...]]
    rotate: Rotate

    def settings(self) -> Iterator[dict[str, float]]:
        """Every point of the grid."""
        for values in itertools.product(*self.grid.values()):
            yield dict(zip(self.grid, values, strict=True))


def global_kiss(voxel: float, distance: float) -> GlobalIcp:
    """Global-ICP where Open3D is missing."""
    return GlobalIcp(KissMatcher(voxel), distance)


def global_open3d(voxel: float, distance: float) -> GlobalIcp:
    """Global-ICP as in the paper."""
    return GlobalIcp(FastGlobal(voxel), distance)


SEARCHES = {
    "local-icp": Search(LocalIcp, {"distance": DISTANCES}, "none"),
    "gicp": Search(Gicp, {"distance": (0.175, 0.3, 0.5), "neighbours": (10, 20)}, "none"),
    "multi-start-icp": Search(
        MultiStartIcp, {"starts": (6, 12), "distance": (0.1, 0.175, 0.5)}, "yaw"
    ),
    "kiss-matcher": Search(KissMatcher, {"voxel": VOXELS}, "yaw"),
    "global-icp by KISS-Matcher": Search(
        global_kiss, {"voxel": VOXELS, "distance": (0.175,)}, "yaw"
    ),
    "global-icp by Open3D": Search(global_open3d, {"voxel": VOXELS, "distance": (0.175,)}, "yaw"),
}


def tried(method: Chained, tracks: list[Track], rotate: Rotate) -> dict[str, float]:
    """The criterion, and what a reader wants beside it."""
    scores = run({"it": RegistersOnly(method.register_track)}, tracks, rotate, seed=0)["it"]
    figures = figures_of(scores)
    errors = np.minimum([row.rotation_deg for row in scores.registrations], ACCURATE_DEG)
    return {
        "criterion_deg": round(float(errors.mean()), 3),
        **{name: figures[name] for name in ("acc30", "rot_median_deg", "trans_median_m")},
    }


def searched(name: str, search: Search, tracks: list[Track]) -> dict[str, Any]:
    """All settings of a baseline, and the best."""
    rows = []
    for settings in search.settings():
        rows.append({**settings, **tried(Chained(search.make(**settings)), tracks, search.rotate)})
        print(name, rows[-1], flush=True)
    best = min(rows, key=lambda row: row["criterion_deg"])
    chosen = {key: best[key] for key in search.grid}
    return {"rotate": search.rotate, "tried": rows, "chosen": chosen}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tracks", type=int, default=8)
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results/baselines.json"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    config = SimulationConfig(tracks=options.tracks, scans=SCANS)
    tracks = list(simulate_tracks(config, SEED, workers=1))
    found = {}
    for name, search in SEARCHES.items():
        try:
            found[name] = searched(name, search, tracks)
        except MissingExtraError as error:
            print(f"{name}: not searched. {error}")
    line = " ".join(["python experiments/search_baselines.py", *sys.argv[1:]])
    record = {
        "data": {"seed": SEED, **asdict(config)},
        "criterion": "mean over scans of min(rotation error, 30 degrees), to the middle scan",
        "baselines": found,
        "provenance": provenance(line),
    }
    write_json(options.out, record)


if __name__ == "__main__":
    with in_a_sentence():
        main()
