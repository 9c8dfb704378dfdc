# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every checkpoint that the package carries exports, and does without torch what it does here.

Tracing takes half a minute. Of weights whose graphs differ in numbers alone one file is made; the
graphs of the others are held against the predictor as they are.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.inference.export.onnx import graph_of
from wildshape.inference.export.verify import prepared
from wildshape.inference.predictor import load
from wildshape.method.checkpoint import SHIPPED
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

EXAMPLE = Path(__file__).parents[3] / "examples" / "06_onnx_inference.py"
NAMES = sorted(path.stem for path in SHIPPED.parent.glob("*.safetensors"))
NUMBERS = ("extent_m", "cost_m", "calibration", "trust", "provenance", "metrics")
SCANS, AS_GRAPH, WITH_TORCH = 200, 24, 6
TURNED = 4  # each so many scans one is turned freely: such are looked at again
# One trace for both files, in a process whose shapes are not checked: the tracer sees no checks.
EXPORT = """
import sys
from pathlib import Path
from wildshape.inference.export.onnx import describe, trace, write_onnx, write_torch
from wildshape.inference.predictor import load
made = load(sys.argv[1], raw=True)
program, said = trace(made), describe(made)
write_onnx(Path("model.onnx"), program, said)
write_torch(Path("model.pt2"), program, said)
"""
ALONE = """
import runpy
import sys
sys.modules["torch"] = sys.modules["wildshape"] = None  # importing them is an ImportError
del sys.argv[0]
runpy.run_path(sys.argv[0], run_name="__main__")
"""
RUN = """
import sys
import numpy as np
given = np.load("given.npz")
if sys.argv[1] == "model.onnx":
    sys.modules["torch"] = None  # importing it is an ImportError
    import onnxruntime
    alone = onnxruntime.SessionOptions()
    alone.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession("model.onnx", alone, ["CPUExecutionProvider"])
    run = lambda scans, drawn: session.run(None, {"scans": scans, "drawn": drawn})
else:
    import torch
    module = torch.export.load(sys.argv[1]).module()
    run = lambda *given: [part.numpy() for part in module(*map(torch.from_numpy, given))]
found = [run(given[f"scans{i}"], given[f"drawn{i}"]) for i in range(int(sys.argv[2]))]
points, _, _, confidence, _, branch = (np.concatenate(parts) for parts in zip(*found))
np.savez(sys.argv[1] + ".npz", points=points, confidence=confidence, branch=branch)
"""


def form(name):
    """What shapes the graph of weights: all settings but the numbers in it."""
    settings = vars(load(name, raw=True).settings)
    return repr({key: value for key, value in settings.items() if key not in NUMBERS})


FILES = {form(name): name for name in reversed(NAMES)}.values()
"""One name of each form."""


def simulated(name):
    """Scans of the kind that the weights were trained on, some of them turned freely."""
    drives = SimulationConfig(tracks=20, scans=10)
    if name != SHIPPED.stem:
        drives = SimulationConfig(tracks=40, scans=5, sensor="depth-camera", category=name)
    tracks = simulate_tracks(drives, seed=21, workers=1)
    scans = [scan for track in tracks for scan in track.scans][:SCANS]
    turns = random_rotation(SCANS, torch.Generator().manual_seed(0)).numpy()
    return [s if i % TURNED else s @ turns[i].T.astype(s.dtype) for i, s in enumerate(scans)]


def is_confidence_of_rounded(made, scan, confidence):
    """Whether rounding explains it: a point at the border of a bin of the cost is in the next."""
    rng = np.random.default_rng(0)
    rounded = [scan * (1 + rng.uniform(-1e-7, 1e-7, scan.shape)) for _ in range(8)]
    found = [made.complete(one.astype(scan.dtype)).confidence for one in rounded]
    return np.abs(np.array(found) - confidence).min() < 1e-3


@pytest.mark.parametrize("name", sorted(set(NAMES) - set(FILES)))
def test_shipped_weights_do_the_same_as_a_graph(name):
    made = load(name, raw=True)
    graph = graph_of(made)
    for scan in simulated(name)[:AS_GRAPH]:
        with torch.inference_mode():
            found = graph(*map(torch.from_numpy, prepared(scan, made.settings.input_points)))
        done = made.complete(scan)
        assert int(found.branch) == done.branch
        np.testing.assert_allclose(found.points[0].numpy(), done.points, atol=1e-4, rtol=0)
        confidence = float(found.confidence)
        near = abs(confidence - done.confidence) < 1e-3
        assert near or is_confidence_of_rounded(made, scan, confidence)


@pytest.mark.parametrize("name", FILES)
def test_shipped_weights_do_the_same_exported(name, tmp_path):
    made = load(name, raw=True)
    scans = simulated(name)
    given = {}
    for i, scan in enumerate(scans):
        given[f"scans{i}"], given[f"drawn{i}"] = prepared(scan, made.settings.input_points)
    np.savez(tmp_path / "given.npz", **given)

    def python(program, *arguments):
        words = [sys.executable, "-c", program, *map(str, arguments)]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr[-2000:]

    python(EXPORT, name)
    done = list(made.complete_many(scans))
    for file, count in (("model.onnx", SCANS), ("model.pt2", WITH_TORCH)):
        python(RUN, file, count)
        found = np.load(tmp_path / f"{file}.npz")
        assert found["branch"].tolist() == [one.branch for one in done[:count]]
        points = np.stack([one.points for one in done[:count]])
        np.testing.assert_allclose(found["points"], points, atol=1e-4, rtol=0)
        confidence = np.array([one.confidence for one in done[:count]])
        others = np.flatnonzero(np.abs(found["confidence"] - confidence) > 1e-3)
        assert len(others) <= count // 50
        assert all(is_confidence_of_rounded(made, scans[i], found["confidence"][i]) for i in others)
    np.save(tmp_path / "scan.npy", scans[1])
    python(ALONE, EXAMPLE, "model.onnx", "scan.npy", "completed.npy")
    np.testing.assert_allclose(np.load(tmp_path / "completed.npy"), done[1].points, atol=1e-4)
