# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What whole commands cost: a self-training step, a long track, a folder on one core and on two.

    python experiments/whole_commands.py [--scans 2000] [--steps 40]

Wall clock, CPU time and peak memory are the system's word on each command after it has ended. What
starting costs is left out by a second, shorter run. Commands are those of the installed version, or
of another one: `PYTHONPATH=OTHER/src python experiments/whole_commands.py`.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from wildshape.cli.main import in_a_sentence
from wildshape.io.tracks import write_track
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

_FEW_STEPS, _FEW_SCANS, _SEEN = 10, 200, 0.8


@dataclass(frozen=True)
class Cost:
    """Of a command, with all its processes; the memory is that of the largest."""

    wall_s: float
    cpu_s: float
    peak_mib: float


def cost_of(*words: str | Path) -> Cost:
    """Run `wildshape` with these words, one thread a process.

    Raises:
        SystemExit: it failed.
    """
    line = [sys.executable, "-m", "wildshape.cli", *map(str, words)]
    began = time.perf_counter()
    nowhere = (os.POSIX_SPAWN_OPEN, 1, os.devnull, os.O_WRONLY, 0)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    child = os.posix_spawn(line[0], line, environment, file_actions=[nowhere])
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit(f"failed: {' '.join(line)}")
    wall = time.perf_counter() - began
    return Cost(wall, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def self_training_step(folder: Path, steps: int) -> float:
    """CPU milliseconds of one step of preset `default` on pseudo-labels of the shipped weights."""

    def trained(count: int) -> float:
        words = ("train", folder / "cars", "--out", folder / f"run-{count}", "--device", "cpu")
        return cost_of(*words, "--teacher", "shipped", "--steps", str(count)).cpu_s

    return 1e3 * (trained(_FEW_STEPS + steps) - trained(_FEW_STEPS)) / steps


def back_and_forth(count: int) -> Track:
    """A car that is passed again and again; each time other points of it are seen."""
    track = next(iter(simulate_tracks(SimulationConfig(tracks=1, scans=40), seed=1, workers=1)))
    there = range(len(track.scans))
    order = islice(cycle((*there, *reversed(there))), count)
    rng = np.random.default_rng(0)
    scans = [track.scans[place] for place in order]
    seen = tuple(scan[rng.random(len(scan)) < _SEEN] for scan in scans)
    names = tuple(f"{number:06d}" for number in range(count))
    return Track("back-and-forth", seen, names, category=track.category)


def long_track(folder: Path, scans: int) -> tuple[float, float]:
    """CPU milliseconds a scan of a track completed as one, and peak memory, MiB."""

    def completed(count: int) -> Cost:
        track = folder / f"track-{count}"
        write_track(track, back_and_forth(count))
        return cost_of("complete", track, "--track", "--out", folder / f"completed-{count}")

    many, few = completed(scans), completed(_FEW_SCANS)
    return 1e3 * (many.cpu_s - few.cpu_s) / (scans - _FEW_SCANS), many.peak_mib


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=2000, help="of the long track")
    parser.add_argument("--steps", type=int, default=40, help="of training")
    given = parser.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        cost_of("simulate", folder / "cars", "--tracks", "24", "--scans", "12", "--seed", "1")
        step = self_training_step(folder, given.steps)
        scan, peak = long_track(folder, given.scans)
        one, two = (
            cost_of("complete", folder / "cars", "--out", folder / f"by-{n}", "--workers", str(n))
            for n in (1, 2)
        )
    print("| what | found |\n|---|---:|")
    print(f"| self-training step, `default`, CPU | {step:.0f} ms |")
    print(f"| track of {given.scans} scans, each, CPU | {scan:.1f} ms |")
    print(f"| its peak memory | {peak:.0f} MiB |")
    for workers, cost in ((1, one), (2, two)):
        print(f"| 288 scans, `--workers {workers}`, wall clock | {cost.wall_s:.1f} s |")
        print(f"| the same, CPU | {cost.cpu_s:.1f} s |")


if __name__ == "__main__":
    with in_a_sentence():
        main()
