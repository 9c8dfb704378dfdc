# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete one scan: shape, pose, box and confidence.

python examples/01_complete_one_scan.py [SCAN [COMPLETED.ply]]
"""

import sys
from pathlib import Path

import numpy as np

import wildshape
from wildshape.io.scans.points import read_points
from wildshape.io.scans.writers import write_ply

SCAN = Path(__file__).parent / "scan.npy"


def main(scan: Path | str = SCAN, out: str = "completed.ply") -> None:
    points = read_points(scan)  # (n, 3), sensor frame, metres
    done = wildshape.load().complete(points)
    write_ply(out, done.points)
    print(f"{len(points)} points in, {len(done.points)} in {out}")
    print(f"box: centre {done.box.centre}, length, width, height {done.box.size}, metres")
    print(f"T_sensor_canonical\n{np.asarray(done.pose).round(3)}")
    print(f"confidence {done.confidence:.2f}{', ' + done.warning if done.warning else ''}")


if __name__ == "__main__":
    main(*sys.argv[1:])
