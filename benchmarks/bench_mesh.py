# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes of completions: closed, how far from the points, how far from the truth, how long.

    python benchmarks/bench_mesh.py            # 300 simulated scans, the shipped weights
    python benchmarks/bench_mesh.py --small    # 12

Distances are 95 % quantiles over a scan, metres, the median over all scans of them: of the
completed `points` to the mesh, of the `mesh` to the completed points, of the `truth` to the mesh.
Where Open3D is installed its screened Poisson reconstruction, normals outward, is measured beside.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import trimesh
from machine import header
from outcome import Outcome
from scipy.spatial import KDTree
from turns import begin, now, options

from wildshape.errors import MissingExtraError
from wildshape.geometry.meshing import closed_mesh
from wildshape.geometry.other_libraries import load_open3d, open3d_cloud
from wildshape.inference.predictor import load
from wildshape.records import Points
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

WATERTIGHT_BAR, HAUSDORFF_BAR_M = 0.99, 0.05
SAMPLES, NEIGHBOURS, DEPTH = 300_000, 24, 6  # of 30,000 the mesh seemed 2 mm farther
Mesher = Callable[[Points], trimesh.Trimesh]
Case = tuple[Points, Points]


def cases(count: int) -> list[Case]:
    """Completed points and the true surface of scans from the middle of drives, canonical frame."""
    tracks = list(simulate_tracks(SimulationConfig(tracks=count, scans=3), seed=7, workers=1))
    found = []
    for track, done in zip(tracks, load().complete_many([track.scans[1] for track in tracks])):
        assert track.T_sensor_object is not None
        assert track.shape is not None
        T_can_sensor = done.pose.inverse()
        T_can_object = T_can_sensor @ track.T_sensor_object[1]
        shape = T_can_sensor.apply_numpy(done.points)
        found.append((shape, T_can_object.apply_numpy(track.shape)))
    return found


def poisson(points: Points) -> trimesh.Trimesh:
    o3d, cloud = load_open3d(), open3d_cloud(points)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    normals = np.asarray(cloud.normals)
    outward = np.sign((normals * (points - points.mean(0))).sum(1))
    cloud.normals = o3d.utility.Vector3dVector(normals * outward[:, None])
    made, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=DEPTH)
    return trimesh.Trimesh(np.asarray(made.vertices), np.asarray(made.triangles))


def meshers(outcome: Outcome) -> dict[str, Mesher]:
    try:
        load_open3d()
    except MissingExtraError as error:
        outcome.note(f"not measured: screened Poisson: {error}")
        return {"closed_mesh": closed_mesh}
    return {"closed_mesh": closed_mesh, "Poisson (Open3D)": poisson}


def measure(mesher: Mesher, held: list[Case]) -> dict[str, list[float]]:
    """Milliseconds, whether closed, and the three distances of every scan."""
    rows = []
    for points, truth in held:
        began = now()
        mesh = mesher(points)
        spent = 1e3 * (now() - began)
        surface = mesh.sample(SAMPLES, seed=0)
        near = KDTree(surface)
        apart = (near.query(points)[0], KDTree(points).query(surface)[0], near.query(truth)[0])
        rows.append((spent, mesh.is_watertight, *(np.quantile(part, 0.95) for part in apart)))
    names = ("ms", "watertight", "points", "mesh", "truth")
    return dict(zip(names, map(list, zip(*rows))))


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_mesh.py"))
    outcome, held = Outcome("mesh"), cases(2 if arguments.smoke else 12 if arguments.small else 300)
    found = {name: measure(mesher, held) for name, mesher in meshers(outcome).items()}
    more: dict[str, Any] = {
        "watertight": {n: float(np.mean(f["watertight"])) for n, f in found.items()}
    }
    for what in ("points", "mesh", "truth"):
        more[f"{what}_95_m"] = {n: float(np.median(f[what])) for n, f in found.items()}
    outcome.add("a mesh of one completion", {n: f["ms"] for n, f in found.items()}, **more)
    ours = found["closed_mesh"]
    outcome.bar("watertight, share", float(np.mean(ours["watertight"])), WATERTIGHT_BAR, least=True)
    outcome.bar(
        "95 % of the points lie so near the mesh (median scan), m",
        float(np.median(ours["points"])),
        HAUSDORFF_BAR_M,
        kind="measured",
    )
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
