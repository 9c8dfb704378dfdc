# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete a scan with onnxruntime and numpy alone.

wildshape export --out model.onnx
python examples/06_onnx_inference.py model.onnx examples/scan.npy completed.npy
"""

import sys

import numpy as np
import onnxruntime


def prepare(points: np.ndarray, count: int) -> dict[str, np.ndarray]:
    """Finite points, each place once, in a fixed order; which `count` of them the network sees."""
    points = np.asarray(points, np.float32)
    points = np.unique(points[np.isfinite(points).all(axis=1)], axis=0)
    if len(points) < 16:
        raise SystemExit(f"{len(points)} different finite points; at least 16 are needed")
    drawn = np.arange(count) % len(points)
    if len(points) > count:
        drawn = np.random.default_rng(0).choice(len(points), count, replace=False)
    return {"scans": points[np.lexsort(points.T)][None], "drawn": drawn[None]}


def main(model: str, scan: str, out: str) -> None:
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    about = session.get_modelmeta().custom_metadata_map
    given = prepare(np.load(scan), int(about["input_points"]))
    found = dict(zip((o.name for o in session.get_outputs()), session.run(None, given)))
    np.save(out, found["points"][0])  # (m, 3), the scan's sensor frame, metres
    T_sensor_canonical = np.column_stack((found["rotation"][0], found["translation"][0]))
    print(f"{given['scans'].shape[1]} points in, {found['points'].shape[1]} out,", end=" ")
    print(f"confidence {found['confidence'][0]:.2f}, pose\n{T_sensor_canonical.round(3)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
