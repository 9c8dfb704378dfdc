# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans a second of the simulator, truth shapes and record making included.

`python benchmarks/bench_simulate.py [--small]`; the bar is 1,000 a second on 2 cores (hdl64).
"""

import argparse
import os
import resource
import time

from wildshape.simulate.config import SensorName
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

_SENSORS: tuple[SensorName, ...] = ("hdl64", "hdl32", "os1-128", "depth-camera")


def _cpu_seconds() -> float:
    """Of this process and of workers that have ended."""
    own, ended = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def measure(sensor: SensorName, tracks: int, workers: int) -> None:
    """Print one line; the wall clock leaves the start of the workers out, CPU time has it."""
    made = simulate_tracks(SimulationConfig(tracks=tracks + 1, sensor=sensor), 0, workers)
    next(made)
    begin, cpu, scans, points = time.perf_counter(), _cpu_seconds(), 0, 0
    for track in made:
        scans += len(track.scans)
        points += sum(len(s) for s in track.scans)
    wall, cpu = time.perf_counter() - begin, _cpu_seconds() - cpu
    print(
        f"{sensor:13s} {workers} workers: {scans / wall:7.0f} scans/s, "
        f"{scans / cpu:6.0f} per CPU second, {points / scans:6.0f} points a scan"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="a few seconds, hdl64 only")
    small = parser.parse_args().small
    for workers in sorted({1, os.cpu_count() or 1}):
        for sensor in _SENSORS[:1] if small else _SENSORS:
            measure(sensor, 120 if small else 240, workers)


if __name__ == "__main__":
    main()
