# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Measure a model beside the baselines; without an argument on simulated drives.

python examples/04_evaluate_against_baselines.py [DATASET [MODEL]]
"""

import sys

import wildshape
from wildshape.baselines.named import baseline
from wildshape.evaluation.method import Method
from wildshape.evaluation.protocol import run
from wildshape.evaluation.tables import markdown
from wildshape.inference.evaluation_adapter import Learned
from wildshape.io.inputs import open_tracks
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


def main(dataset: str = "", model: str | None = None) -> None:
    drives = SimulationConfig(tracks=6, scans=6)
    names = ("identity", "one-scan", "local-icp")
    methods: dict[str, Method] = {name: baseline(name) for name in names}
    methods["wildshape"] = Learned(wildshape.load(model))
    runs = []
    for seed in range(2):  # of the turns: each scan is turned by its own random yaw
        tracks = open_tracks(dataset) if dataset else simulate_tracks(drives, seed=9, workers=1)
        runs.append(run(methods, tracks, rotate="yaw", seed=seed))
    print(markdown(runs))


if __name__ == "__main__":
    main(*sys.argv[1:])
