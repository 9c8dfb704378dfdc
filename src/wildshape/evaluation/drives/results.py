# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An evaluation of drives as `metrics.json`, `vehicles.json` and the table that people read."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.evaluation.drives.labels import Counting
from wildshape.evaluation.drives.protocol import DriveScores
from wildshape.evaluation.tables import pipe_table
from wildshape.io.atomic import write_json, write_text
from wildshape.io.progress import counted

FORMAT = 1
FILES = ("metrics.json", "vehicles.json", "table.md")
DETECTION = (
    *(f"AP {name}" for name in ("BEV 0.5", "BEV 0.7", "3D 0.5", "3D 0.7")),
    "recall at 90 %",
)
TRACKING = ("HOTA", "switches", "tracks a vehicle", "impure", "length, width, height, m")
UNITS = {
    "average_precision": "0 to 1, area under the envelope of precision over recall",
    "recall_at_90": "0 to 1, largest recall at a precision of 0.9 or more",
    "hota": "0 to 1, mean over overlaps 0.05 to 0.95, bird's eye view",
    "size_bias_m": "metres, found minus labelled length, width, height",
    "drift_percent": "of the way travelled, last place seen from the first pose",
    "ate_m": "metres, root mean square after rigid alignment",
    "rpe_m": "metres from scan to scan, root mean square",
    "rpe_deg": "degrees from scan to scan, root mean square",
}
_CORRECTED = {
    "labels carried": "their labels were carried to the times of the scans",
    "labels not carried": "their labels were not, so that **boxes and labels are of other times**",
}
_DASH = "–"  # noqa: RUF001


def as_json(scores: DriveScores, counting: Counting, made: Mapping[str, object]) -> dict[str, Any]:
    """The content of `metrics.json`."""
    rows = {}
    for row in scores.rows:
        figures = asdict(row)
        figures.pop("name")
        figures.pop("vehicles")
        rows[row.name] = figures
    return {
        "format": FORMAT,
        "units": UNITS,
        "counting": asdict(counting),
        "methods": rows,
        "trajectories": [None if one is None else asdict(one) for one in scores.trajectories],
        "corrections": list(scores.corrections),
        "cameras": scores.cameras,
        "provenance": dict(made),
    }


def write_results(
    folder: Path, scores: DriveScores, counting: Counting, made: Mapping[str, object]
) -> str:
    """Write all files, atomically; returns the table."""
    table = markdown(scores, counting)
    vehicles = {row.name: [asdict(one) for one in row.vehicles] for row in scores.rows}
    write_json(folder / "vehicles.json", {"format": FORMAT, "methods": vehicles})
    write_text(folder / "table.md", table)
    write_json(folder / "metrics.json", as_json(scores, counting, made))
    return table


def markdown(scores: DriveScores, counting: Counting) -> str:
    """Detection, tracking, and what counted."""
    found = as_json(scores, counting, {})
    rows = found["methods"].items()
    detection = [[name, *detection_cells(figures)] for name, figures in rows]
    tracking = [[name, *tracking_cells(figures)] for name, figures in rows]
    tables = (
        pipe_table(["boxes", *DETECTION], detection),
        pipe_table(["boxes", *TRACKING], tracking),
    )
    return "\n\n".join((*tables, "\n".join(f"- {line}" for line in notes(found)))) + "\n"


def detection_cells(figures: Mapping[str, Any]) -> list[str]:
    """The `DETECTION` of a row of `metrics.json`."""
    detections = figures["detections"]
    precisions = [_percent(one["average_precision"]) for one in detections]
    return [*precisions, _percent(detections[0]["recall_at_90"])]


def tracking_cells(figures: Mapping[str, Any]) -> list[str]:
    """The `TRACKING` of a row of `metrics.json`."""
    purity, bias = figures["purity"], figures["size_bias_m"]
    tracks = purity["tracks_per_vehicle"]
    return [
        _percent(None if figures["hota"] is None else figures["hota"]["hota"]),
        str(figures["identity_switches"]),
        _DASH if tracks is None else f"{tracks:.2f}",
        str(purity["impure_tracks"]),
        _DASH if bias is None else " ".join(f"{side:+z.2f}" for side in bias),
    ]


def _percent(value: float | None) -> str:
    return _DASH if value is None else f"{100 * value:.1f}"


def notes(found: Mapping[str, Any]) -> list[str]:
    """What the figures of `metrics.json` are of, a sentence or two each."""
    ours = next(iter(found["methods"].values()))
    lines = [
        f"Counted: {counted(ours['labels'], 'label')} of"
        f" {counted(ours['purity']['vehicles'], 'vehicle')} with"
        f" {found['counting']['points']} points or more;"
        f" {ours['purity']['vehicles_found']} of them found.",
        "AP in percent; recall in percent at IoU 0.5 in bird's eye view (BEV), as HOTA's overlap.",
        "Length, width, height: mean of found minus labelled.",
    ]
    if cameras := found.get("cameras"):  # of older results it is not known
        within = f"within {found['counting']['range_m']:g} m"
        lines.append(f"Drives of which only what the camera sees {within} counts: {cameras}.")
    for correction, said in _CORRECTED.items():
        if drives := found["corrections"].count(correction):
            lines.append(f"Drives corrected for motion: {drives}; {said}.")
    known = [one for one in found["trajectories"] if one is not None]
    drifts = [one["drift_percent"] for one in known if one["drift_percent"] is not None]
    if known:
        drift = f"{np.mean(drifts):.2f} %, at most {max(drifts):.2f} %" if drifts else _DASH
        lines.append(
            f"Trajectory: drift {drift} of {sum(one['way_m'] for one in known):.0f} m; ATE"
            f" {np.mean([one['ate_m'] for one in known]):.3f} m; RPE"
            f" {np.mean([one['rpe_m'] for one in known]):.4f} m,"
            f" {np.mean([one['rpe_deg'] for one in known]):.3f} degrees."
        )
    return lines
