# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A report of whatever `complete`, `register`, `evaluate` and `train` left in a folder.

Looked for in the folder and two levels below: metrics.json with the figures beside it, log.jsonl,
wildshape.json, and track folders with objects.json, completed/, poses.txt. What is absent is left
out.
"""

import json
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.geometry.se3 import SE3
from wildshape.io.guard import reading
from wildshape.io.inputs import open_tracks
from wildshape.io.points import METRES, Unit, read_points
from wildshape.io.poses import read_poses
from wildshape.records import Box, Track
from wildshape.report.content import Cloud, Figure, Report, ReportObject, Table
from wildshape.report.parts import metrics_table, track_object, training_curves

MAX_OBJECTS = 24
_MARKER, _OBJECTS = "wildshape.json", "objects.json"


def report_from_folder(folder: Path, inputs: Path | None = None) -> Report:
    """What a folder holds, as a report.

    Args:
        folder: the `--out` of one or several commands.
        inputs: the scans that were completed, if they have moved from where objects.json says.
            Where they cannot be read only the completed shapes are shown.

    Raises:
        BadInputError: no such folder, nothing to report in it, or a damaged file.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise BadInputError(f"{folder}: no such folder; name the --out of an earlier command.")
    metrics = [(path, _json(path)) for path in _find(folder, "metrics.json")]
    curves = [curve for log in _find(folder, "log.jsonl") for curve in training_curves(log)]
    tracks = [path.parent for path in _find(folder, _OBJECTS)]
    if not (metrics or curves or tracks):
        raise BadInputError(
            f"{folder}: holds no objects.json, metrics.json or log.jsonl to report; run complete, "
            "evaluate or train with --out first."
        )
    return Report(
        title=f"Wildshape report: {folder.resolve().name}",
        summary=_summary(len(tracks), len(metrics), len(curves)),
        tables=tuple(_checked_table(*entry) for entry in metrics),
        curves=tuple(curves),
        objects=tuple(_checked_object(track, inputs) for track in tracks[:MAX_OBJECTS]),
        notes=_notes(tracks),
        provenance=_provenance(folder, metrics),
        figures=tuple(_figure(file) for path, _ in metrics for file in _pictures(path)),
    )


def _find(folder: Path, name: str) -> list[Path]:
    found = {path for depth in ("", "*/", "*/*/") for path in folder.glob(f"{depth}{name}")}
    return sorted(found)


def _json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        data = error
    if isinstance(data, dict):
        return data
    raise BadInputError(
        f"{path}: expected a JSON object, found {str(data)[:80]!r}; write it again with the "
        "command that made it."
    )


def _pictures(metrics: Path) -> list[Path]:
    return sorted(metrics.parent.glob("*.png"))


def _figure(picture: Path) -> Figure:
    return Figure(picture.stem.replace("_", " "), picture.read_bytes())


def _summary(tracks: int, metrics: int, curves: int) -> str:
    counted = ((tracks, "track"), (metrics, "evaluation"), (curves, "training curve"))
    parts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in counted if n]
    return f"Found here: {', '.join(parts)}."


def _notes(tracks: list[Path]) -> tuple[str, ...]:
    more = len(tracks) - MAX_OBJECTS
    return (f"{more} more tracks are in the folder and not drawn here.",) if more > 0 else ()


def _provenance(folder: Path, metrics: list[tuple[Path, dict[str, Any]]]) -> dict[str, Any]:
    """Of each command's output, under its place in the folder."""
    outputs = [(path, _json(path)) for path in _find(folder, _MARKER)] + metrics
    return {
        str(path.relative_to(folder)): found["provenance"]
        for path, found in outputs
        if found.get("provenance")
    }


def _checked_table(path: Path, metrics: dict[str, Any]) -> Table:
    """`metrics_table`, a damaged metrics.json named."""
    with reading(path, "what evaluate writes"):
        return metrics_table(metrics)


def _checked_object(folder: Path, inputs: Path | None) -> ReportObject:
    """`_object`, a damaged objects.json named."""
    with reading(folder / _OBJECTS, "what complete or register writes"):
        return _object(folder, inputs)


def _object(folder: Path, inputs: Path | None) -> ReportObject:
    """One track: its middle scan completed, and all scans fused where they can be read."""
    found = _json(folder / _OBJECTS)
    named = inputs or (Path(found["input"]) if found.get("input") else None)
    track = _input_track(named, folder) if named is not None else None
    if track is None:
        return _completed_only(folder, found)
    name = track.scan_names[track.middle]
    completed = folder / "completed" / f"{name}.ply"
    entry = _entry(found, name)
    return track_object(
        track,
        completed=read_points(completed) if completed.exists() else None,
        box=_box(entry),
        T_middle_scan=_registered(folder / "poses.txt", track),
        facts=_facts(entry),
    )


def _completed_only(folder: Path, found: dict[str, Any]) -> ReportObject:
    completed = sorted((folder / "completed").glob("*.ply"))
    missing = "the input scans cannot be read"
    if not completed:
        return ReportObject(folder.name, missing)
    scan = completed[len(completed) // 2]
    entry = _entry(found, scan.stem)
    return ReportObject(
        name=folder.name,
        subtitle=f"scan {scan.stem}; {missing}",
        clouds=(Cloud("completed", read_points(scan)),),
        box=_box(entry),
        facts=_facts(entry),
    )


def _input_track(inputs: Path, folder: Path) -> Track | None:
    """The track that `folder` is about; None if the scans have moved, changed or lost it."""
    try:
        source = open_tracks(inputs, _unit(folder.parent / _MARKER))
        return source[source.names.index(folder.name)]
    except (BadInputError, ValueError):
        return None


def _unit(marker: Path) -> Unit:
    settings = _json(marker).get("settings") or {} if marker.exists() else {}
    unit: Unit = settings.get("unit", "m")
    return unit if unit in METRES else "m"


def _registered(path: Path, track: Track) -> SE3 | None:
    """`T_middle_scan = T_middle_can inv(T_scan_can)`, METHOD 7; None without a pose a scan."""
    if not path.exists() or len(track.scans) < 2:
        return None
    T_sensor_can = read_poses(path)
    if len(T_sensor_can) != len(track.scans):
        return None
    return T_sensor_can[track.middle] @ T_sensor_can.inverse()


def _entry(found: dict[str, Any], name: str) -> dict[str, Any]:
    """What objects.json says of a scan."""
    return next((scan for scan in found.get("scans") or () if scan.get("scan") == name), {})


def _box(entry: dict[str, Any]) -> Box | None:
    if not entry.get("box"):
        return None
    x, y, z = (float(v) for v in entry["box"]["centre"])
    length, width, height = (float(v) for v in entry["box"]["size"])
    qw, qx, qy, qz = (float(v) for v in entry["box"]["quaternion_wxyz"])
    return Box((x, y, z), (length, width, height), (qw, qx, qy, qz))


def _facts(entry: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    known = {
        "confidence": lambda value: f"{value:.2f}",
        "box": lambda box: " x ".join(f"{side:.2f}" for side in box["size"]) + " m",
        "refined": lambda value: "yes" if value else "no",
        "seconds": lambda value: f"{1000 * value:.0f} ms",
        "warning": str,
    }
    wanted = [key for key in known if entry.get(key) not in (None, "")]
    return tuple(("time" if k == "seconds" else k, known[k](entry[k])) for k in wanted)
