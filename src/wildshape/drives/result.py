# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What decides a drive's result, what `drive` gives back, and which files it may write."""

import hashlib
import shlex
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.detections import DetectionFile
from wildshape.drives.writing.folder import (
    BOXES,
    FRAMES,
    MCAP,
    MESHES,
    RRD,
    SHAPES,
    TRAJECTORY,
    TUM,
)
from wildshape.inference.folders.box_files import BOX_FILES
from wildshape.inference.predictor import Predictor
from wildshape.io.guard import reading, record_of
from wildshape.io.output import MARKER
from wildshape.io.scans.writers import MESH_FORMATS

REPORT = "report.html"
FILES = (
    BOXES,
    FRAMES,
    TRAJECTORY,
    TUM,
    "tracks/*/track.json",
    "tracks/*/rays/*.npz",
    "tracks/*/scans/*.ply",
    "objects/*/objects.json",
    "objects/*/poses.txt",
    "objects/*/completed/*.ply",
    f"{SHAPES}/*.ply",
    *(f"{MESHES}/*.{kind}" for kind in MESH_FORMATS),
    *BOX_FILES,
    MCAP,
    RRD,
    REPORT,
    "stages/**/*",
    "first/**/*",
    "adapted/**/*",
    "adapted.json",
)


@dataclass(frozen=True)
class DriveResult:
    """What was found in a drive.

    Attributes:
        out: the folder written.
        frames: of the drive.
        candidates: objects tracked, vehicles or not.
        vehicles: their names.
        boxes: lines of `boxes.csv`.
        moving: vehicles that move.
        warnings: what is odd about the drive, a sentence each.
        seconds: by stage, of all runs that it took, were some interrupted.
        workers: how many did the work of the last of them.
    """

    out: Path
    frames: int
    candidates: int
    vehicles: tuple[str, ...]
    boxes: int
    moving: int
    warnings: tuple[str, ...]
    seconds: dict[str, float]
    workers: int = 1


def settings_of(
    source: Path,
    recording: Drive,
    topic: str | None,
    config: DriveConfig,
    predictor: Predictor,
    detections: DetectionFile | None,
) -> dict[str, Any]:
    """What decides a drive's result, as JSON values; arguments as of `drive`."""
    return {
        "source": str(source.resolve()),
        "recording": recording.fingerprint,
        **({} if topic is None else {"topic": topic}),
        "drive": asdict(config),
        **identity_of(predictor),
        **({} if detections is None else detections.identity()),
    }


def identity_of(predictor: Predictor) -> dict[str, Any]:
    """What decides what a predictor finds, as JSON values; the defaults of `load` are left out."""
    level = predictor.up == predictor.settings.up
    raw = predictor.refines != predictor.settings.facing
    return {
        "model": predictor.settings.provenance,
        "weights": _hash_of(predictor),
        "inference": asdict(predictor.config),
        **({} if level else {"level": False}),
        **({"raw": True} if raw else {}),
    }


def _hash_of(predictor: Predictor) -> str:
    """Of its weights and settings: what two models are told apart by."""
    digest = hashlib.sha256(repr(predictor.settings).encode())
    for name, values in sorted(predictor.network.state_dict().items()):
        digest.update(name.encode() + np.ascontiguousarray(values.cpu().numpy()).tobytes())
    return digest.hexdigest()[:16]


def line_of(
    source: Path,
    out: Path,
    topic: str | None,
    config: DriveConfig,
    detections: DetectionFile | None,
    model: Path | None = None,
) -> str:
    """The command that finds the same; arguments as of `drive`, `model`: that was loaded.

    Another config than the commands' is said to come from Python.
    """
    chosen = [] if topic is None else ["--topic", topic]
    if model is not None:
        chosen += ["--model", str(model)]
    if detections is not None:
        chosen += ["--detections", str(detections.path)]
        if detections.calibration is not None:
            chosen += ["--calibration", str(detections.calibration)]
        if detections.least_score is not None:
            chosen += ["--min-score", f"{detections.least_score:g}"]
    if config.rays:
        chosen.append("--rays")
    line = shlex.join(("wildshape", "drive", str(source), "--out", str(out), *chosen))
    usual = replace(config, rays=False) == DriveConfig()
    return line if usual else f"{line} # from Python, with the config in settings"


def earlier_result(out: Path, record: dict[str, Any]) -> DriveResult:
    """What an earlier run found, by its record."""
    with reading(out / MARKER, "what `wildshape drive` says of itself"):
        return record_of(DriveResult, {**record["result"], "out": out}, {})
