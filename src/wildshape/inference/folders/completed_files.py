# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is written of a completed track: shapes, poses, `objects.json` (docs/formats.md)."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wildshape.geometry.transforms.se3 import stack
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import write_json
from wildshape.io.output import file_name
from wildshape.io.poses import write_poses
from wildshape.io.scans.points import write_ply
from wildshape.records import Completion, Track

OBJECTS, POSES, COMPLETED = "objects.json", "poses.txt", "completed"
_MODEL = ("command", "code", "time_utc", "steps", "seed")  # said of a model


def write_completed(
    folder: Path, track: Track, done: Sequence[Completion], predictor: Predictor, source: Path
) -> None:
    """Write a track completed from all its scans together; `objects.json` last.

    Args:
        folder: of the track.
        track: its scans' names become names of files.
        done: one a scan.
        predictor: what completed them.
        source: where the scans come from.
    """
    for name, one in zip(track.scan_names, done, strict=True):
        write_ply(folder / COMPLETED / f"{file_name(name)}.ply", one.points)
    write_poses(folder / POSES, stack([one.pose for one in done]))
    said = objects_of(track, done, predictor, source, together=True)
    write_json(folder / OBJECTS, said)


def objects_of(
    track: Track,
    done: Sequence[Completion],
    predictor: Predictor,
    source: Path,
    *,
    together: bool,
    skipped: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """What `objects.json` holds; `skipped`: names of scans and why they could not be used."""
    return {
        "format": 1,
        "track": track.name,
        "input": str(source.resolve()),
        "uses": "track" if together else "scan",
        "together": together,
        "category": track.category,
        "sensor": track.sensor.kind,
        "model": {name: predictor.settings.provenance.get(name) for name in _MODEL},
        "inference": asdict(predictor.config),
        "scans": [describe(name, one) for name, one in zip(track.scan_names, done)],
        "skipped": [{"scan": scan, "reason": reason} for scan, reason in skipped],
    }


def describe(name: str, done: Completion) -> dict[str, Any]:
    """A completed scan without its points; metres, the scan's sensor frame."""
    return {
        "scan": name,
        "box": asdict(done.box),
        "confidence": done.confidence,
        "refined": done.refined,
        "seconds": done.seconds,
        "branch": done.branch,
        "cost_m": done.cost,
        "warning": done.warning,
        "reasons": done.reasons,
    }
