# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Register and fuse the scans of a track; without an argument a simulated drive past a car.

python examples/02_register_and_fuse_a_track.py [TRACK [FUSED.ply]]
"""

import sys

import numpy as np

import wildshape
from wildshape.inference.registration import fuse_scans
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import read_track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


def main(folder: str = "", out: str = "fused.ply") -> None:
    drive = SimulationConfig(tracks=1, scans=12)
    track = read_track(folder) if folder else next(simulate_tracks(drive, seed=1, workers=1))
    model = wildshape.load()
    T_middle_scan = model.register_track(track.scans, track.sensor, track=True)
    fused = fuse_scans(track.scans, T_middle_scan)
    write_ply(out, fused)
    print(f"{len(track.scans)} scans of {track.name}: {len(fused)} points in {out}")
    if (true := track.T_sensor_object) is not None and len(track.scans) > 1:
        error = T_middle_scan.inverse() @ true[track.middle] @ true.inverse()
        # The middle scan is registered to itself: no test.
        degrees = np.delete(error.angle().rad2deg().numpy(), track.middle)
        print(f"median rotation error against the truth: {np.median(degrees):.2f} degrees")


if __name__ == "__main__":
    main(*sys.argv[1:])
