# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A trained network as one file for other runtimes: ONNX, or a `torch.export` program."""

import io
import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path

import torch
from torch.export import Dim, ExportedProgram

from wildshape.errors import MissingExtraError
from wildshape.inference.export.graph import OUTPUTS, CompletionGraph
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import atomic_write
from wildshape.io.output import provenance
from wildshape.method.checkpoint import ModelSettings

INPUTS, OPSET = ("scans", "drawn"), 18
_EXTRA = ("onnx", "onnxscript", "onnxruntime")


def trace(predictor: Predictor) -> ExportedProgram:
    """The graph of a predictor, batch and number of points left open."""
    graph = graph_of(predictor)
    sizes = ({0: Dim.DYNAMIC, 1: Dim.DYNAMIC}, {0: Dim.DYNAMIC, 1: Dim.DYNAMIC})
    ahead = torch.tensor((10.0, 0.0, 0.0))
    scans = torch.randn(2, 64, 3, generator=torch.Generator().manual_seed(0)) + ahead
    drawn = torch.arange(48).repeat(2, 1)
    with torch.no_grad(), _quiet():
        return torch.export.export(graph, (scans, drawn), dynamic_shapes=sizes, strict=False)


def graph_of(predictor: Predictor) -> CompletionGraph:
    """What `Predictor.complete` does with `raw=True`, as a module of its own."""
    network = deepcopy(predictor.network).requires_grad_(False)
    return CompletionGraph(network, _settings(predictor), predictor.config.hypothesis).eval()


def write_onnx(path: Path, program: ExportedProgram, metadata: dict[str, str]) -> None:
    """Write a traced graph as ONNX, atomically; the metadata goes into the model's properties.

    Raises:
        MissingExtraError: the `onnx` extra is not installed.
    """
    require_onnx()
    import onnx

    with _quiet():
        exported = torch.onnx.export(
            program,
            input_names=list(INPUTS),
            output_names=list(OUTPUTS),
            opset_version=OPSET,
            dynamo=True,
            external_data=False,
            verbose=False,
        )
    assert exported is not None
    model = exported.model_proto
    onnx.helper.set_model_props(model, metadata)
    with atomic_write(path) as file:
        file.write(model.SerializeToString())


def write_torch(path: Path, program: ExportedProgram, metadata: dict[str, str]) -> None:
    """Write a traced graph for `torch.export.load`, atomically."""
    buffer = io.BytesIO()
    torch.export.save(program, buffer, extra_files={"wildshape.json": json.dumps(metadata)})
    with atomic_write(path) as file:
        file.write(buffer.getvalue())


def describe(predictor: Predictor) -> dict[str, str]:
    """What a user of the file must know: settings, origin, and the points a scan may have."""
    settings = _settings(predictor)
    described = {**asdict(settings), "provenance": settings.provenance}
    described["projection"]["kind"] = type(settings.projection).__name__
    return {
        "wildshape": json.dumps(provenance("wildshape export")),
        "settings": json.dumps(described),
        "sensor": settings.sensor,
        "input_points": str(settings.input_points),
        "refined": "no: the network's own answer, as wildshape.load(raw=True) gives it",
        "outputs": ",".join(OUTPUTS),
        "unit": "m",
    }


def _settings(predictor: Predictor) -> ModelSettings:
    """Its network's, less what `load(level=False)` leaves away."""
    return replace(predictor.settings, up=predictor.up)


def require_onnx() -> None:
    """Say which extra is missing.

    Raises:
        MissingExtraError: a library of the `onnx` extra is not installed.
    """
    absent = [name for name in _EXTRA if find_spec(name) is None]
    if absent:
        raise MissingExtraError(
            f"{absent[0]} is not installed; install with: pip install 'wildshape[onnx]'"
        )


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the exporter's own warnings, which a user can do nothing about."""
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        log.setLevel(level)
