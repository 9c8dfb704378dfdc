# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The exported graph does what the predictor does: in plain torch, in ONNX, for any sizes."""

import json
import runpy
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.projection.visibility import Bins, FacingBins, PixelBins, PolarBins
from wildshape.geometry.sampling import drawn, sorted_points
from wildshape.inference.config import HypothesisRule, InferenceConfig
from wildshape.inference.export import onnx, verify
from wildshape.inference.export.graph import OUTPUTS
from wildshape.inference.export.onnx import describe, graph_of
from wildshape.inference.export.plain_scores import nearest_both_plain, score_plain, visible_plain
from wildshape.inference.export.verify import (
    compare,
    export_model,
    open_exported,
    prepared,
    rehearsal_scans,
)
from wildshape.inference.predictor import Predictor, load
from wildshape.method.checkpoint import SHIPPED, ModelSettings, save_checkpoint
from wildshape.method.confidence import Calibration
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import NetworkConfig, ShapePoseNet
from wildshape.method.ray_encoder import RayConfig
from wildshape.ops.nearest import nearest_both
from wildshape.ops.zbuffer import visible

ROOT = Path(__file__).parents[3]
CONFIG = NetworkConfig(
    encoder=(16, 16, 32, 32), decoder=(32, 32), pose=(16, 16), points=300, mirror=True, scale=2.0
)
SETTINGS = ModelSettings(
    network=replace(CONFIG, selector=True),
    sensor="lidar",
    input_points=96,
    projection=FacingBins(0.3),
    beta=0.25,
    belief=0.05,
    extent_m=(2.0, 6.0),
)


CALIBRATION = Calibration(
    weights=(0.3, 0.2, 0.1, 0.2, -0.5, 0.1, -0.2, 0.1, 0.05, -0.4),
    bias=0.2,
    sigma=2.0,
    within_m=0.3,
)
UP = (0.02, 0.0, 0.9998)


# What the other exported models have not, all at once: a setting that has one value in all of them
# could end in a traceback, or be ignored, and no test would know.
OTHERS = {
    "camera.onnx": {
        "network": replace(
            CONFIG, points=151, branches=1, spread="sphere", mirror=False, start=(0.5, 0.5, 0.5)
        ),
        "sensor": "camera",
        "calibration": CALIBRATION,
        "projection": PixelBins(flat=True),
        "facing": True,
        "extent_m": (0.5, 1.5),
    },
    "model.pt2": {  # not facing: traced in this process, for nothing in it is looked at twice
        "network": replace(CONFIG, selector=True, rays=RayConfig(count=8)),  # graphs see none
        "projection": PolarBins(0.03, 0.04, flat=True),
        "beta": 0.5,
        "cost_m": (0.02, 0.03),
        "up": UP,
        "calibration": CALIBRATION,
    },
}


def resample(points, count):
    return sorted_points(points)[drawn(len(points), count)]


def predictor(**changes):
    """Random weights; their poses are tilted, so scans that face their object are seen twice."""
    torch.manual_seed(0)
    settings = replace(SETTINGS, **changes)
    network = ShapePoseNet(settings.network)
    with torch.no_grad():
        network.pose.bias3.add_(0.3 * torch.randn_like(network.pose.bias3))
    return Predictor(network.eval(), settings, raw=True)


@pytest.fixture(scope="module")
def facing():
    return predictor(facing=True, up=UP, calibration=CALIBRATION, extent_m=(2.0, 12.0))


@pytest.fixture(scope="module")
def exported(facing, tmp_path_factory):
    """What the command says and writes; in a process whose shapes are not checked.

    The tracer cannot see through those checks.
    """
    folder = tmp_path_factory.mktemp("export")
    return folder, command(facing, folder)


def command(made, folder, *arguments):
    """What `wildshape export` says."""
    save_checkpoint(folder / "model.safetensors", made.network, made.settings)
    words = (sys.executable, "-m", "wildshape.cli", "export", "model.safetensors", "--json")
    done = subprocess.run((*words, "--scans", "4", *arguments), cwd=folder, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def onnx_file(exported):
    return exported[0] / "model.onnx"


def test_neighbours_from_one_product():
    a, b = torch.randn(3, 50, 3) * 2, torch.randn(3, 70, 3) * 2
    for plain, found in zip(nearest_both_plain(a, b), nearest_both(a, b)):
        torch.testing.assert_close(plain, found.distance_squared.sqrt(), atol=1e-4, rtol=0)


def test_z_buffer_from_two_scatters():
    """Ties to the smallest index, bins outside the image never seen."""
    generator = torch.Generator().manual_seed(0)
    index = torch.randint(-2, 12, (4, 200), generator=generator)
    depth = torch.randint(1, 4, (4, 200), generator=generator).float()
    assert torch.equal(visible_plain(Bins(index, depth, 10)), visible(index, depth, 10))


@pytest.mark.parametrize("projection", [FacingBins(0.3), PolarBins(0.02, 0.03), PixelBins()])
def test_costs_are_those_of_the_loss(projection):
    generator = torch.Generator().manual_seed(1)
    scans = torch.randn(2, 90, 3, generator=generator)
    posed = torch.randn(2, 4, 150, 3, generator=generator)
    centres = torch.tensor([[9.0, 1, -1], [3.0, 6, 8]])
    exact = score_hypotheses(scans, centres, posed, projection)
    plain = score_plain(scans, centres, posed, projection)
    torch.testing.assert_close(plain.observation, exact.observation, atol=1e-5, rtol=0)
    torch.testing.assert_close(plain.projection, exact.projection, atol=1e-5, rtol=0)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"facing": True, "calibration": CALIBRATION},
        {"facing": True, "calibration": CALIBRATION, "up": UP},
        {"sensor": "camera", "projection": PixelBins(), "calibration": CALIBRATION},
        {"projection": PolarBins(0.03, 0.04, flat=True), "calibration": CALIBRATION},
        {"extent_m": (20.0, 30.0)},
        {"extent_m": (0.5, 1.0)},
    ],
    ids=["centred", "facing", "level", "camera", "flat", "too small", "too large"],
)
def test_graph_is_the_predictor(changes):
    made = predictor(**changes)
    same_as_predictor(graph_of(made), made)


def test_confidence_of_odd_scans_is_the_predictors():
    """Beside the camera, larger than any trained on but not by much, of more points than known."""
    rng = np.random.default_rng(0)
    scan = rng.uniform((-0.6, -0.5, 3.0), (0.6, 0.5, 4.0), (60_000, 3)).astype(np.float32)
    for sensor, high, at, known in (
        ("lidar", 2.0, (6.0, 0.0, 0.0), True),
        ("lidar", 1.5, (6.0, 0.0, 0.0), True),
        ("lidar", 1.0, (6.0, 0.0, 0.0), False),
        ("camera", 2.0, (0.0, 0.0, 0.0), True),
        ("camera", 2.0, (4.0, 0.0, -2.0), False),
    ):
        made = predictor(sensor=sensor, extent_m=(0.5, high), calibration=CALIBRATION)
        given = scan + np.array(at, np.float32)
        with torch.inference_mode():
            found = graph_of(made)(*map(torch.from_numpy, prepared(given, 96)))
        confidence = made.complete(given).confidence
        assert float(found.confidence) == pytest.approx(confidence, abs=1e-3)
        assert (confidence > 0) == known


def same_as_predictor(graph, made):
    for scan in rehearsal_scans(made.settings, 6):
        with torch.inference_mode():
            found = graph(*map(torch.from_numpy, prepared(scan, 96)))
        done = made.complete(scan)
        assert int(found.branch) == done.branch
        np.testing.assert_allclose(found.points[0].numpy(), done.points, atol=1e-4)
        torch.testing.assert_close(
            found.rotation[0].double(), done.pose.rotation, atol=1e-5, rtol=0
        )
        assert float(found.cost) == pytest.approx(done.cost, abs=1e-5)
        assert float(found.confidence) == pytest.approx(done.confidence, abs=1e-4)


def test_a_predictor_that_knows_no_level_exports_none():
    held = predictor(facing=True, up=UP)
    askew = Predictor(held.network, held.settings, raw=True, level=False)
    same_as_predictor(graph_of(askew), askew)
    assert json.loads(describe(held)["settings"])["up"] == list(UP)
    assert json.loads(describe(askew)["settings"])["up"] is None


def test_onnx_is_torch(facing, onnx_file):
    scans = rehearsal_scans(facing.settings, 32, seed=1)
    found = compare(open_exported(onnx_file, threads=1), facing, scans)
    assert found.largest_m < 1e-4
    assert found.other_branch == 0


def test_onnx_takes_any_batch_and_any_number_of_points(facing, onnx_file):
    runner = open_exported(onnx_file, threads=1)
    for batch, count, seen in ((1, 16, 16), (3, 33, 40), (5, 200, 96)):
        scans = np.stack([resample(s, count) for s in rehearsal_scans(facing.settings, batch)])
        drawn = np.arange(seen)[None].repeat(batch, axis=0) % count
        together = runner(scans, drawn)
        for i in range(batch):
            alone = runner(scans[i : i + 1], drawn[i : i + 1])
            np.testing.assert_allclose(together[0][i], alone[0][0], atol=1e-4)


def test_torch_program_is_torch(tmp_path):
    made = predictor(**OTHERS["model.pt2"])
    save_checkpoint(tmp_path / "model.safetensors", made.network, made.settings)
    found = export_model(tmp_path / "model.safetensors", tmp_path / "model.pt2", scans=4)
    assert found.largest_m < 1e-4
    assert (found.scans, found.other_branch) == (4, 0)
    again = compare(open_exported(tmp_path / "model.pt2"), made, rehearsal_scans(made.settings, 2))
    assert again.largest_m < 1e-4


def test_command_says_how_far_from_torch(exported):
    folder, said = exported
    assert {path.name for path in folder.iterdir()} == {"model.safetensors", "model.onnx"}
    assert said["largest_m"] < 1e-4
    assert (said["scans"], said["other_branch"]) == (4, 0)
    assert said["bytes"] == (folder / said["out"]).stat().st_size


@pytest.fixture
def export_with(tmp_path, monkeypatch):
    """Exports a model to a file that adds `value` to an output of its first `scans` scans."""

    def export(output, value, scans):
        made, out = predictor(), tmp_path / "out.pt2"
        save_checkpoint(tmp_path / "model.safetensors", made.network, made.settings)
        graph, left = graph_of(made), iter([value] * scans)

        def runner(*inputs):
            with torch.inference_mode():
                found = graph(*map(torch.from_numpy, inputs))._asdict()
            found[output] = found[output] + next(left, 0.0)
            return [part.numpy() for part in found.values()]

        monkeypatch.setattr(onnx, "trace", lambda _: None)
        monkeypatch.setattr(onnx, "write_torch", lambda path, *_: path.touch())
        monkeypatch.setattr(verify, "open_exported", lambda _: runner)
        return out, export_model(tmp_path / "model.safetensors", out, scans=10)

    return export


ODD = [(output, *how) for output in OUTPUTS[:-1] for how in ((np.nan, 1), (np.inf, 1), (0.01, 2))]


@pytest.mark.parametrize(("output", "value", "scans"), [*ODD, ("branch", 1, 2)])
def test_a_file_that_gives_something_else_is_not_written(
    output, value, scans, export_with, tmp_path
):
    with pytest.raises(BadInputError, match=r"out\.pt2: not written"):
        export_with(output, value, scans)
    assert not (tmp_path / "out.pt2").exists()


@pytest.mark.parametrize("output", ["confidence", "cost"])
def test_a_cost_that_rounding_moves_over_a_border_is_said(output, export_with):
    out, found = export_with(output, 0.01, 1)
    assert (found.other_cost, found.scans, found.other_branch) == (1, 10, 0)
    assert found.largest_m < 1e-4
    assert out.exists()


def test_example_needs_no_torch(facing, onnx_file, tmp_path, monkeypatch, capsys):
    source = (ROOT / "examples" / "06_onnx_inference.py").read_text(encoding="utf-8")
    assert "torch" not in source
    assert "import wildshape" not in source
    points = np.load(ROOT / "examples" / "scan.npy")
    scan, out = tmp_path / "scan.npy", tmp_path / "completed.npy"
    np.save(scan, np.concatenate((points, points[:500])))  # `complete` takes each place once, too
    monkeypatch.setattr("sys.argv", ["example", str(onnx_file), str(scan), str(out)])
    runpy.run_path(str(ROOT / "examples" / "06_onnx_inference.py"), run_name="__main__")
    done = facing.complete(np.load(scan))
    np.testing.assert_allclose(np.load(out), done.points, atol=1e-4)
    assert f"300 out, confidence {done.confidence:.2f}" in capsys.readouterr().out


def test_other_settings_export(tmp_path):
    said = command(predictor(**OTHERS["camera.onnx"]), tmp_path, "--out", "camera.onnx")
    assert said["largest_m"] < 1e-4
    assert said["other_branch"] == 0


@pytest.mark.parametrize("record", [ModelSettings, NetworkConfig])
def test_every_setting_has_two_values_among_exported_models(record):
    shipped = [load(path).settings for path in SHIPPED.parent.glob("*.safetensors")]
    every = [SETTINGS, *shipped, *(replace(SETTINGS, **changes) for changes in OTHERS.values())]
    held = every if record is ModelSettings else [settings.network for settings in every]
    alike = {f.name for f in fields(record) if len({repr(getattr(s, f.name)) for s in held}) < 2}
    # Other encoders than PCN's, and what they alone read, are refused: tests/cli/test_encoder.py.
    assert alike <= {"backbone", "neighbours", "centres"}


def test_the_file_says_what_it_is(onnx_file):
    import onnx

    held = {entry.key: entry.value for entry in onnx.load(onnx_file).metadata_props}
    assert held["input_points"] == "96"
    projection = json.loads(held["settings"])["projection"]
    assert (projection["kind"], projection["cell_m"]) == ("FacingBins", 0.3)


def test_the_rule_of_a_predictor_is_that_of_its_graph():
    points = torch.from_numpy(np.load(ROOT / "examples" / "scan.npy")).float()[None]
    upside_down = points * torch.tensor((1.0, -1.0, -1.0))
    drawn = torch.arange(upside_down.shape[1])[None]
    cost, own = {}, {}
    for bound in (HypothesisRule().upright_rad, 4.0):  # 4 radians: nothing is rolled as far
        rule = HypothesisRule(upright_rad=bound)
        made = load(raw=True, config=InferenceConfig(hypothesis=rule))
        with torch.no_grad():
            cost[bound] = float(graph_of(made)(upside_down, drawn).cost)
        own[bound] = made.complete(upside_down[0]).cost
    assert own[4.0] > own[HypothesisRule().upright_rad]
    assert cost[HypothesisRule().upright_rad] < cost[4.0], "only the first takes a second look"
