# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The packed store at size: writing, opening, and drawing training scans from it at random.

`python benchmarks/bench_store.py [--full]`; 20,000 scans, or a million with `--full` (2 GB of disk,
in TMPDIR). Bars: a million scans open in under a second in a fresh process, 10,000
scans a second are drawn on 2 cores, and comparing each scan with its checksum when it is first
met costs 5 % of that at most. What the scans are: `many_scans.py`.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from itertools import count
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from machine import header, median, peak_mib, verdict
from many_scans import ManyScans
from turns import begin, options, set_clock, take_turns

from wildshape.datasets.convert import convert
from wildshape.io.store.store import open_store

_OPENING = """
import sys, time
began = time.perf_counter()
from wildshape.io.store.store import open_store
imported = time.perf_counter()
store = open_store(sys.argv[1])
print(imported - began, time.perf_counter() - imported, store.scan_count)
"""
_SECONDS = 6.0
_COMPARED = 256


def write(path: Path, scans: int) -> None:
    began, cpu = time.perf_counter(), cpu_seconds()
    convert(ManyScans(scans), path)
    wall, cpu = time.perf_counter() - began, cpu_seconds() - cpu
    size = sum(file.stat().st_size for file in path.iterdir())
    workers = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(
        f"writing  {scans:,} scans, {size / 1e9:.2f} GB: {wall:.1f} s, {scans / wall:,.0f} scans/s"
        f" ({scans / cpu:,.0f} per CPU second); peak memory {peak_mib():.0f} MiB here,"
        f" {workers:.0f} MiB the largest worker"
    )


def opening(path: Path, times: int) -> None:
    """In fresh processes, the files' pages dropped from memory before each."""
    seconds = []
    for _ in range(times):
        forget(path)
        said = subprocess.run(
            [sys.executable, "-c", _OPENING, str(path)], capture_output=True, text=True, check=True
        ).stdout.split()
        seconds.append((float(said[0]), float(said[1])))
    imports, opens = (median(list(values)) for values in zip(*seconds))
    print(
        f"opening  {1000 * opens:.1f} ms, median of {times} cold processes"
        f" (importing torch and wildshape before that: {imports:.1f} s)"
    )
    print(verdict("seconds to open", opens, 1.0, kind="clock"))


def forget(path: Path) -> None:
    for file in path.iterdir():
        descriptor = os.open(file, os.O_RDONLY)
        os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        os.close(descriptor)


def sampling(path: Path, workers: int, seconds: float) -> None:
    """512 points of random scans: by the store alone, and batches by the trainer's own reader.

    That reader finds the centre of each scan when it first meets it, which costs more than all
    else; in a store of this size nearly all scans of a run's first minutes are met first.
    """
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for label, work in (("reading", read), ("drawing", draw)):
            found = list(pool.map(work, [path] * workers, range(workers), [seconds] * workers))
            rate = sum(a_second for a_second, _ in found)
            alone = sum(a_cpu_second for _, a_cpu_second in found) / workers
            print(
                f"{label}  {rate:,.0f} scans/s of 512 points, {workers} processes"
                f" ({alone:,.0f} per CPU second)"
            )
            print(verdict(f"{label}, scans a second", rate, 10_000, least=True, kind="clock"))


def read(path: Path, seed: int, seconds: float) -> tuple[float, float]:
    """Random scans of the store, resampled: per second and per CPU second."""
    store, rng = open_store(path), np.random.default_rng(seed)

    def some() -> int:
        for scan in rng.integers(store.scan_count, size=256):
            points = store.scan_points(int(scan))
            points.take(rng.integers(len(points), size=512), axis=0)
        return 256

    return rate_of(some, seconds)


def draw(path: Path, seed: int, seconds: float) -> tuple[float, float]:
    """Batches of the trainer's reader, the same way."""
    import torch

    from wildshape.training.batches.views import ViewConfig, ViewSampler

    torch.set_num_threads(1)
    store = open_store(path)
    sampler = ViewSampler(store, np.arange(len(store)), ViewConfig(tracks=64, points=512))
    steps = count()
    return rate_of(lambda: len(sampler.draw(seed, next(steps)).scans), seconds)


def comparing(path: Path) -> None:
    """What checksums cost the trainer's reader in a run that meets every scan once, by CPU time.

    The same scans by turns: compared, and taken for compared already.
    """
    import torch

    from wildshape.training.batches.views import ViewConfig, ViewSampler

    torch.set_num_threads(1)
    set_clock(cpu=True)
    store, rng = open_store(path), np.random.default_rng(0)
    sampler = ViewSampler(store, np.arange(len(store)), ViewConfig(points=512))
    scans = list(range(_COMPARED))

    def meet(*, compared: bool) -> None:
        store._checked[:_COMPARED] = bytes([compared]) * _COMPARED
        sampler._centres[:_COMPARED] = np.nan
        sampler.gather(scans, rng)

    seconds = take_turns(
        {"compared": lambda: meet(compared=False), "trusted": lambda: meet(compared=True)},
        2 * _SECONDS,
    )
    ratio = min(seconds["compared"]) / min(seconds["trusted"])
    print(f"comparing  scans met first take {ratio:.3f} x the time that reading alone takes")
    print(verdict("cost of checksums", ratio, 1.05, kind="measured"))


def rate_of(work: Callable[[], int], seconds: float) -> tuple[float, float]:
    done, began, cpu = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - began < seconds:
        done += work()
    return done / (time.perf_counter() - began), done / (time.process_time() - cpu)


def cpu_seconds() -> float:
    both = (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


def main() -> None:
    parser = options(__doc__)
    parser.add_argument("--full", action="store_true", help="a million scans")
    settings = begin(parser)
    print(header("bench_store.py"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "store"
        write(path, 1_000_000 if settings.full else 500 if settings.smoke else 20_000)
        opening(path, 1 if settings.smoke else 5)
        sampling(path, min(os.cpu_count() or 1, 2), 0.1 if settings.smoke else _SECONDS)
        comparing(path)


if __name__ == "__main__":
    main()
