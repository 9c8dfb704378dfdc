# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How fast a sequence of SemanticKITTI becomes tracks, on one core, and in how much memory.

python benchmarks/bench_convert.py [--frames N] [--small]

Replays made-up scans of a real one's size as a long sequence: every 50 frames the cars get new
numbers. Memory must not grow with --frames.
"""

import tempfile
import time
from pathlib import Path

import numpy as np
from machine import header, peak_mib, verdict
from turns import begin, options

from wildshape.datasets.semantic_kitti.reader import SemanticKitti

_POINTS, _CARS, _ON_CAR, _BLOCK, _FRAMES = 124_000, 8, 1000, 50, 6


def made_up(folder: Path) -> Path:
    """Cars of random points in a cloud of random points: nobody looks at shapes here."""
    rng = np.random.default_rng(0)
    for name in ("velodyne", "labels"):
        (folder / name).mkdir(parents=True)
    for i in range(_FRAMES):
        points = rng.uniform((-40, -40, -40, 0), (40, 40, 40, 1), (_POINTS, 4)).astype("<f4")
        labels = np.full(_POINTS, 40, "<u4")
        for car in range(_CARS):
            mine = slice(car * _ON_CAR, (car + 1) * _ON_CAR)
            points[mine, :3] = rng.uniform((-2, -0.9, -0.7), (2, 0.9, 0.7), (_ON_CAR, 3)) + 3 * car
            labels[mine] = (car + 1) << 16 | 10
        points.tofile(folder / "velodyne" / f"{i:06d}.bin")
        labels.tofile(folder / "labels" / f"{i:06d}.label")
    (folder / "calib.txt").write_text("Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n")
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n" * _FRAMES)
    return folder


def replay(source: Path, folder: Path, frames: int) -> None:
    """Write a long sequence: links to the scans, labels with numbers that move on."""
    scans = sorted((source / "velodyne").glob("*.bin"))
    poses = (source / "poses.txt").read_text().splitlines()
    for name in ("velodyne", "labels"):
        (folder / name).mkdir(parents=True)
    (folder / "calib.txt").write_text((source / "calib.txt").read_text())
    (folder / "poses.txt").write_text("".join(f"{poses[i % len(scans)]}\n" for i in range(frames)))
    for i in range(frames):
        scan = scans[i % len(scans)]
        (folder / "velodyne" / f"{i:06d}.bin").symlink_to(scan.resolve())
        found = np.fromfile(source / "labels" / f"{scan.stem}.label", "<u4")
        block = np.uint32(600 * (i // _BLOCK % 100) << 16)
        np.where(found >> 16 > 0, found + block, found).tofile(folder / "labels" / f"{i:06d}.label")


def main() -> None:
    parser = options(__doc__)
    parser.set_defaults(threads=1)
    parser.add_argument("--frames", type=int, help="300; small: 100")
    arguments = begin(parser)
    frames = arguments.frames or (6 if arguments.smoke else 100 if arguments.small else 300)
    print(header("bench_convert"))
    with tempfile.TemporaryDirectory() as scratch:
        replay(made_up(Path(scratch) / "made_up"), Path(scratch) / "00", frames)
        began, tracks, scans = time.perf_counter(), 0, 0
        for track in SemanticKitti(Path(scratch) / "00").tracks_of("00"):
            tracks, scans = tracks + 1, scans + len(track.scans)
        seconds = time.perf_counter() - began
    print(f"{frames} frames, {tracks} tracks, {scans} scans in {seconds:.1f} s")
    print(verdict("frames a second", frames / seconds, 10, least=True, kind="clock"))
    print(verdict("peak memory, MiB", peak_mib(), 1024))


if __name__ == "__main__":
    main()
