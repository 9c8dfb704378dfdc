# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Oriented boxes of every scan and a mesh of the object, out of a track of raw LiDAR scans.

python examples/05_boxes_and_meshes_of_a_track.py [TRACK [FOLDER]]
"""

import sys
from dataclasses import asdict
from pathlib import Path

import wildshape
from wildshape.io.atomic import write_json
from wildshape.io.scans.writers import write_mesh
from wildshape.io.tracks import read_track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


def main(folder: str = "", out: str = "boxes") -> None:
    drive = SimulationConfig(tracks=1, scans=8)
    track = read_track(folder) if folder else next(simulate_tracks(drive, seed=1, workers=1))
    done = wildshape.load().complete_track(track.scans, track.sensor)
    boxes = {name: asdict(one.box) for name, one in zip(track.scan_names, done, strict=True)}
    write_json(Path(out) / "boxes.json", boxes)
    mesh = done[track.middle].mesh()
    write_mesh(Path(out) / "mesh.glb", mesh)
    print(f"{len(boxes)} boxes, the middle scan's {done[track.middle].box}")
    print(f"mesh: {len(mesh.faces)} triangles, closed: {mesh.is_watertight}")


if __name__ == "__main__":
    main(*sys.argv[1:])
