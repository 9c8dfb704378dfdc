# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An exported file held against the predictor that it was made from."""

import math
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch

from wildshape.errors import BadInputError
from wildshape.geometry.sampling import drawn, sorted_points
from wildshape.inference.config import ExportRule
from wildshape.inference.export import onnx
from wildshape.inference.export.onnx import INPUTS
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import lock_folder, naming, released_after
from wildshape.method.checkpoint import ModelSettings
from wildshape.records import Completion, Points

SUFFIXES = (".onnx", ".pt2")
_RULE = ExportRule()

Runner = Callable[[np.ndarray, np.ndarray], list[np.ndarray]]


class Difference(NamedTuple):
    """How far an exported file is from torch.

    Attributes:
        largest_m: of any coordinate of any completed point or translation, and of any entry of a
            rotation, where both chose the same branch; infinite where any number is not finite.
        other_branch: scans whose branches cost the same to the last digits, so that another won.
        scans: compared.
        other_cost: scans with the same branch and another cost or confidence: rounding moves a
            point over the border of a bin of the cost.
    """

    largest_m: float
    other_branch: int
    scans: int
    other_cost: int


def export_model(model: Path | None, out: Path, scans: int = 24) -> Difference:
    """Write a model as one file, compare it with torch, and keep it only if it does the same.

    Args:
        model: checkpoint or folder of a run; None: the shipped one.
        out: .onnx, or .pt2 for `torch.export.load`.
        scans: compared.

    Raises:
        BadInputError: the model cannot be exported, or the file does not do what torch does.
        MissingExtraError: the `onnx` extra is not installed.
    """
    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise BadInputError(f"{out}: give --out one of {', '.join(SUFFIXES)}.")
    if scans < 1:
        raise BadInputError(f"--scans {scans}: compare at least one scan.")
    if suffix == ".onnx":
        onnx.require_onnx()
    predictor = load(model, raw=True)
    if predictor.settings.network.backbone != "pcn":
        raise BadInputError(
            f"{model}: its encoder is {predictor.settings.network.backbone}, and only"
            " networks with PCN's encoder are exported; train without --encoder."
        )
    write = onnx.write_onnx if suffix == ".onnx" else onnx.write_torch
    out.parent.mkdir(parents=True, exist_ok=True)
    with _checked_before(out) as draft:
        write(draft, onnx.trace(predictor), onnx.describe(predictor))
        rehearsed = rehearsal_scans(predictor.settings, scans)
        found = compare(open_exported(draft), predictor, rehearsed)
        _refuse_other(out, found)
    return found


@contextmanager
def _checked_before(path: Path) -> Iterator[Path]:
    """A file that gets its final name only if the block ends without an error, which names that.

    Its folder has one name for all runs: what a killed one left there goes with the next.
    """
    folder = path.with_name(f".{path.name}.part")
    with naming(path), released_after(folder):
        lock_folder(folder)
        try:
            draft = folder / f"model{path.suffix.lower()}"
            yield draft
            draft.replace(path)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _refuse_other(path: Path, found: Difference) -> None:
    """Raise if an exported model does something else than torch."""
    most = _RULE.other_share * found.scans
    if found.largest_m > _RULE.largest_m or max(found.other_branch, found.other_cost) > most:
        raise BadInputError(
            f"{path}: not written, the exported model differs from torch by"
            f" {found.largest_m:.3g} m, chose another pose for {found.other_branch} of"
            f" {found.scans} scans and gave another cost or confidence for {found.other_cost};"
            " please report this with the model."
        )


def open_exported(path: Path, threads: int = 0) -> Runner:
    """What runs a file: onnxruntime for `.onnx`, torch for `.pt2`; `threads` 0 takes all cores."""
    if path.suffix == ".pt2":
        module = torch.export.load(path).module()
        return lambda *inputs: [part.numpy() for part in module(*map(torch.from_numpy, inputs))]
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    return lambda *inputs: [
        np.asarray(part) for part in session.run(None, dict(zip(INPUTS, inputs, strict=True)))
    ]


def compare(runner: Runner, predictor: Predictor, scans: Sequence[Points]) -> Difference:
    """Both complete the same scans; costs, metres, and confidences may be as far apart as points.

    Args:
        runner: runs the file.
        predictor: that it was made from.
        scans: sensor frame, metres.
    """
    largest, branches, costs = 0.0, 0, 0
    for scan, done in zip(scans, predictor.complete_many(scans)):
        *found, branch = runner(*prepared(scan, predictor.settings.input_points))
        *places, confidence, cost = _apart(found, done)
        if not np.isfinite((*places, confidence, cost)).all():
            largest = math.inf
        elif int(branch[0]) != done.branch:
            branches += 1
        else:
            largest = max(largest, *places)
            costs += max(confidence, cost) > _RULE.largest_m
    return Difference(largest, branches, len(scans), costs)


def _apart(found: Sequence[np.ndarray], done: Completion) -> list[float]:
    """The largest difference of each output but the branch, in the order of `OUTPUTS`."""
    pose = done.pose
    same = (
        done.points,
        pose.rotation.numpy(),
        pose.translation.numpy(),
        done.confidence,
        done.cost,
    )
    return [float(np.abs(a[0] - b).max()) for a, b in zip(found, same, strict=True)]


def prepared(scan: Points, count: int) -> tuple[np.ndarray, np.ndarray]:
    """What an exported file takes of one scan."""
    return sorted_points(scan)[None], drawn(len(scan), count)[None]


def rehearsal_scans(settings: ModelSettings, count: int, seed: int = 0) -> list[Points]:
    """Half-seen ellipsoids of the size trained on, all around the sensor: enough to compare.

    They need no data set, and are as hard on the arithmetic as real scans.
    """
    rng = np.random.default_rng(seed)
    low, high = settings.extent_m
    length = min(high, 10.0) / 2 if low == 0 else (low + min(high, 2 * low)) / 2
    return [_half_ellipsoid(rng, length, settings.sensor == "camera") for _ in range(count)]


def _half_ellipsoid(rng: np.random.Generator, length: float, ahead: bool) -> Points:
    ball = rng.normal(size=(int(rng.integers(60, 1500)), 3))
    ball *= np.array((0.5, 0.2, 0.16)) * length / np.linalg.norm(ball, axis=1, keepdims=True)
    heading = rng.uniform(0, 2 * np.pi)
    cos, sin = np.cos(heading), np.sin(heading)
    turned = ball @ np.array(((cos, -sin, 0), (sin, cos, 0), (0, 0, 1.0))).T
    bearing, distance = rng.uniform(0, 2 * np.pi), length * rng.uniform(1.5, 5)
    at = distance * np.array((np.cos(bearing), np.sin(bearing), rng.uniform(-0.1, 0.1)))
    at = np.array((0.0, 0.0, distance)) if ahead else at
    facing = turned[turned @ at < 0]
    return (facing + at).astype(np.float32)
