# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A report's parts from what the rest of the project hands over: tracks, metrics, a run's log."""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.baselines.named import NAMES
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Points, Track
from wildshape.report.content import Cell, Cloud, Curve, ReportObject, Table

ROTATE = {
    "none": "Scans as recorded",
    "yaw": "Each scan turned by its own random yaw",
    "so3": "Each scan turned by its own random rotation",
}
# heading, key in metrics.json, factor, decimals
_COLUMNS = (
    ("CD, m", "cd", 1, 3),
    ("precision, m", "precision", 1, 3),
    ("coverage, m", "coverage", 1, 3),
    ("acc ≤ 30°, %", "acc30", 100, 1),
    ("rotation, °", "rot_median_deg", 1, 1),
    ("translation, m", "trans_median_m", 1, 2),
    ("acc ≤ 30° sym, %", "acc30_sym", 100, 1),
    ("rotation sym, °", "rot_sym_median_deg", 1, 1),
    ("box IoU", "box_iou", 1, 3),
    ("heading ≤ 30°, %", "heading30", 100, 1),
    ("heading ≤ 30° sym, %", "heading30_sym", 100, 1),
)
_TRAINED_RIVALS = ("dpc", "oracle")  # and what their names begin, such as dpc-lidar
_VALIDATION = "validation/"
_NO_TERMS = ("step", "branch_shares", "steps_per_second")


def track_object(
    track: Track,
    *,
    completed: Points | None = None,
    box: Box | None = None,
    T_middle_scan: SE3 | None = None,
    T_middle_scan_icp: SE3 | None = None,
    subtitle: str = "",
    facts: Sequence[tuple[str, str]] = (),
) -> ReportObject:
    """A track as a row of panels, everything in the sensor frame of its middle scan.

    Args:
        track: its truth, where it has one, becomes a panel.
        completed: `(m, 3)` from the middle scan, in that scan's frame, metres.
        box: in the same frame.
        T_middle_scan: one pose a scan, by us; fuses the track.
        T_middle_scan_icp: the same by ICP.
        subtitle: by default the scan, its size and the track's source.
        facts: (label, value) pairs.
    """
    middle = track.middle
    clouds = [Cloud("input scan", track.scans[middle], size=2.6)]
    if track.shape is not None and track.T_sensor_object is not None:
        truth = track.T_sensor_object[middle].apply_numpy(track.shape)
        clouds.append(Cloud("truth", truth))
    if T_middle_scan is not None:
        clouds.append(Cloud("fused by us", fuse(track.scans, T_middle_scan)))
    if T_middle_scan_icp is not None:
        clouds.append(Cloud("ICP fused", fuse(track.scans, T_middle_scan_icp)))
    if completed is not None:
        clouds.append(Cloud("completed", completed))
    return ReportObject(
        name=track.name,
        subtitle=subtitle or _subtitle(track),
        clouds=tuple(clouds),
        box=box,
        facts=tuple(facts),
        sensor=track.sensor.kind,
    )


def fuse(scans: Sequence[Points], T_middle_scan: SE3) -> Float[np.ndarray, "f 3"]:
    """All scans moved to the middle scan's frame (METHOD 7)."""
    return np.concatenate([T_middle_scan[i].apply_numpy(scan) for i, scan in enumerate(scans)])


def metrics_table(metrics: Mapping[str, Any]) -> Table:
    """The content of `metrics.json` as a table; our rows, those of no baseline, are bold."""
    methods: dict[str, dict[str, Any]] = dict(metrics.get("methods") or {})
    names = list(methods)
    seeds = len(metrics.get("seeds") or ()) or 1
    rotate = str(metrics.get("rotate", ""))
    return Table(
        title=ROTATE.get(rotate, rotate or "Evaluation"),
        columns=("method", *(column[0] for column in _COLUMNS), "scans"),
        rows=tuple((name, *_figures(methods[name]), _counted(methods[name])) for name in names),
        caption=_caption(methods, seeds),
        emphasis=tuple(i for i, name in enumerate(names) if is_ours(name)),
    )


def is_ours(method: str) -> bool:
    """Whether a row is a model of ours: none of the baselines, DPC's variants or the oracle."""
    return method not in NAMES and not method.lower().startswith(_TRAINED_RIVALS)


def training_curves(log: Path) -> tuple[Curve, ...]:
    """The curves of a run's `log.jsonl`; a line cut off by a kill is left out."""
    entries = list(_entries(log))
    loss = _series(entries, _terms(entries))
    held_out = _series(entries, tuple(f"{_VALIDATION}{k}" for k in ("observation", "projection")))
    cycle = _series(entries, (f"{_VALIDATION}cycle_deg",))
    curves = (
        Curve("Loss", "step", "metres", loss, log_y=True),
        Curve("Share of each pose branch", "step", "share", _shares(entries)),
        Curve("Held-out tracks, without truth", "step", "metres", held_out, log_y=True),
        Curve("Cycle consistency on held-out tracks", "step", "degrees", cycle),
    )
    return tuple(curve for curve in curves if curve.series)


def _subtitle(track: Track) -> str:
    scan = track.scan_names[track.middle]
    points = len(track.scans[track.middle])
    parts = (track.category, f"scan {scan} of {len(track.scans)}", f"{points} points", track.source)
    return ", ".join(part for part in parts if part)


def _figures(figures: Mapping[str, Any]) -> list[Cell]:
    spread = figures.get("std") or {}
    return [_figure(figures.get(k), spread.get(k), f, d) for _, k, f, d in _COLUMNS]


def _figure(mean: float | None, std: float | None, factor: int, digits: int) -> Cell:
    if mean is None:
        return None
    text = f"{factor * mean:.{digits}f}"
    return text if std is None else f"{text} ± {factor * std:.{digits}f}"


def _counted(figures: Mapping[str, Any]) -> Cell:
    counted = figures.get("scans_counted") or {}
    return max(counted.values(), default=None)


def _caption(methods: Mapping[str, Mapping[str, Any]], seeds: int) -> str:
    points = ", ".join(
        f"{name} {figures['points']:,.0f} points (floor {figures['cd_floor']:.3f} m)"
        for name, figures in methods.items()
        if figures.get("points") and figures.get("cd_floor")
    )
    skipped = sum(sum((m.get("scans_skipped") or {}).values()) for m in methods.values())
    parts = (
        "CD = precision + coverage, Euclidean; rotation and translation are medians against the "
        "middle scan; sym counts a half turn as right.",
        f"Mean ± standard deviation of {seeds} seeds." if seeds > 1 else "",
        f"Counts beside CD: {points}." if points else "",
        f"{skipped} scans skipped, all methods together." if skipped else "",
    )
    return " ".join(part for part in parts if part)


def _entries(log: Path) -> Iterable[dict[str, Any]]:
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            continue
        if isinstance(entry, dict) and _is_number(entry.get("step")):
            yield entry


def _terms(entries: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """The loss and its terms, whatever their objective calls them, in the order of the log."""
    names = dict.fromkeys(name for entry in entries for name in entry)
    return tuple(n for n in names if n not in _NO_TERMS and not n.startswith(_VALIDATION))


def _series(
    entries: Sequence[Mapping[str, Any]], keys: tuple[str, ...]
) -> tuple[tuple[str, list[float], list[float]], ...]:
    """One series a key that has a number other than zero anywhere."""
    series = []
    for key in keys:
        pairs = [(float(e["step"]), float(e[key])) for e in entries if _is_number(e.get(key))]
        if any(y != 0 for _, y in pairs):
            name = key.removeprefix(_VALIDATION).removesuffix("_deg")
            series.append((name, [x for x, _ in pairs], [y for _, y in pairs]))
    return tuple(series)


def _shares(
    entries: Sequence[Mapping[str, Any]],
) -> tuple[tuple[str, list[float], list[float]], ...]:
    rows = [e for e in entries if _are_numbers(e.get("branch_shares"))]
    branches = min((len(row["branch_shares"]) for row in rows), default=0)
    steps = [float(row["step"]) for row in rows]
    return tuple(
        (f"branch {i}", steps, [float(row["branch_shares"][i]) for row in rows])
        for i in range(branches)
    )


def _are_numbers(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_number, value))


def _is_number(value: object) -> bool:
    """Whether it is a finite number that a float can hold; a JSON integer has no largest."""
    return isinstance(value, int | float) and abs(value) <= sys.float_info.max
