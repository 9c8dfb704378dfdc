# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans a second of the simulator: tracks with truth shapes and records, and whole drives.

python benchmarks/bench_simulate.py [--small]
"""

import os
import resource
import time
from collections.abc import Iterator
from itertools import islice
from typing import get_args

from machine import header
from outcome import Outcome
from turns import begin, options, set_clock

from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.simulate.sensor import SensorName
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

_SENSORS: tuple[SensorName, ...] = get_args(SensorName)
_WARM_S, _ENDLESS = 5.0, 10**6  # the workers are at work then
_SCANS_BAR, _BARRED, _DRIVE = 1000, "hdl64", "whole drive, hdl64"


def _cpu_seconds() -> float:
    """Of this process and of workers that have ended."""
    own, ended = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime


def measure(sensor: SensorName, tracks: int, workers: int) -> tuple[list[float], float, float]:
    """Milliseconds a scan of each track, scans a CPU second, points a scan.

    The wall clock leaves the start of the workers out, CPU time has it.
    """
    cpu, warm = _cpu_seconds(), _WARM_S if workers > 1 else 0.0
    made = simulate_tracks(SimulationConfig(tracks=_ENDLESS, sensor=sensor), 0, workers)
    before = _until(made, time.perf_counter() + warm)
    begin = time.perf_counter()
    found = [track.scans for track in islice(made, tracks)]
    wall = time.perf_counter() - begin
    del made  # its workers end
    scans = sum(map(len, found))
    points = sum(len(scan) for track in found for scan in track)
    return [1e3 * wall / scans], (before + scans) / (_cpu_seconds() - cpu), points / scans


def _until(made: Iterator[Track], moment: float) -> int:
    """Scans made until then; at least one track's."""
    scans = 0
    for track in made:
        scans += len(track.scans)
        if time.perf_counter() >= moment:
            break
    return scans


def measure_drive(scans: int) -> tuple[list[float], float, float]:
    """As `measure`, of the scans of a whole drive by one process; the street is laid out before."""
    drive = WholeDrive(StreetConfig(scans=scans + 1), 0)
    drive.scan(0)
    begin, cpu = time.perf_counter(), _cpu_seconds()
    points = sum(len(drive.scan(number).points) for number in range(1, scans + 1))
    wall, cpu = time.perf_counter() - begin, _cpu_seconds() - cpu
    return [1e3 * wall / scans], scans / cpu, points / scans


def main() -> None:
    arguments = begin(options(__doc__))
    set_clock(cpu=False)  # what counts here is the wall, with all workers
    print(header("bench_simulate.py"))
    outcome = Outcome("simulate", unit="ms a scan")
    tracks = 4 if arguments.smoke else 120 if arguments.small else 240
    for sensor in _SENSORS[:1] if arguments.small else _SENSORS:
        counts = sorted({os.cpu_count() or 1, 1}, reverse=True)
        found = {f"{workers} workers": measure(sensor, tracks, workers) for workers in counts}
        outcome.add(
            sensor,
            {name: times for name, (times, _, _) in found.items()},
            scans_a_second={name: 1e3 / times[0] for name, (times, _, _) in found.items()},
            scans_a_cpu_second={name: rate for name, (_, rate, _) in found.items()},
            points_a_scan={name: points for name, (_, _, points) in found.items()},
        )
    times, rate, points = measure_drive(2 if arguments.smoke else 60)
    outcome.add(
        _DRIVE,
        {"1 workers": times},
        scans_a_second={"1 workers": 1e3 / times[0]},
        scans_a_cpu_second={"1 workers": rate},
        points_a_scan={"1 workers": points},
    )
    best = min(row["best"] for row in outcome.rows if row["case"] == _BARRED)
    outcome.bar(f"{_BARRED}: scans a second", 1e3 / best, _SCANS_BAR, least=True, kind="clock")
    outcome.bar(f"{_DRIVE}: scans a second", 1e3 / times[0], 2, least=True, kind="clock")
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
