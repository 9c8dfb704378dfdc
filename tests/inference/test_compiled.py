# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A compiled network computes the same; where there is no compiler it is the network itself.

Inductor takes a minute: `benchmarks/bench_compile.py` runs it, here dynamo alone does. In a process
whose shapes are not checked: the tracer cannot see through those checks.
"""

import json
import subprocess
import sys

from tests.models import CONFIG, SETTINGS

from wildshape.inference import predictor
from wildshape.method.network import ShapePoseNet

_PROGRAM = """
import json, warnings
import torch
from wildshape.inference.compiled import compiled
from wildshape.method.network import NetworkConfig, ShapePoseNet

torch.manual_seed(0)
sizes = {"encoder": (8, 8, 16, 16), "decoder": (16, 16), "pose": (8, 8), "points": 40}
network = ShapePoseNet(NetworkConfig(**sizes, mirror=True, selector=True)).eval()
made = compiled(network, 24, backend="eager")
apart = []
for batch in (1, 2, 5):
    scans = torch.randn(batch, 24, 3)
    with torch.inference_mode():
        pairs = zip(made(scans), network(scans), strict=True)
        apart += [float((ours - theirs).abs().max()) for ours, theirs in pairs]

def no_compiler(*_):
    raise RuntimeError("no C++ compiler\\nanywhere")

with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    kept = compiled(network, 24, backend=no_compiler)
print(json.dumps({
    "apart": max(apart),
    "another": made is not network,
    "names": made.state_dict().keys() == network.state_dict().keys(),
    "kept": kept is network,
    "said": [str(w.message) for w in said if w.category is RuntimeWarning],
}))
"""


def test_the_same_for_any_batch_and_a_sentence_without_a_compiler():
    ran = subprocess.run([sys.executable, "-c", _PROGRAM], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    found = json.loads(ran.stdout)
    assert found["apart"] < 1e-5
    assert found["another"]
    assert found["names"]
    assert found["kept"]
    (sentence,) = found["said"]
    assert "runs uncompiled" in sentence
    assert "no C++ compiler anywhere)" in sentence
    assert "\n" not in sentence


def test_a_predictor_that_is_compiled_leaves_the_other_as_it_was(monkeypatch):
    network, made = ShapePoseNet(CONFIG).eval(), ShapePoseNet(CONFIG).eval()
    monkeypatch.setattr(predictor, "compiled", lambda *_: made)
    of = predictor.Predictor(network, SETTINGS, level=False)
    fast = of.compile()
    assert (fast.network, of.network) == (made, network)
    assert (fast.up, fast.config, fast.refines) == (of.up, of.config, of.refines)
