# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A report of whatever `complete`, `register`, `evaluate` and `train` left in a folder.

Looked for in the folder and two levels below: metrics.json with the figures beside it, log.jsonl,
and track folders with completed/, poses.txt, objects.json. What is absent is left out.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.geometry.se3 import SE3
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.points import read_points
from wildshape.io.poses import read_poses
from wildshape.records import Box, Track
from wildshape.report.content import Cloud, Figure, Report, ReportObject
from wildshape.report.parts import metrics_table, track_object, training_curves

MAX_OBJECTS = 24


def report_from_folder(folder: Path, inputs: Path | None = None) -> Report:
    """What a folder holds, as a report.

    Args:
        folder: the `--out` of one or several commands.
        inputs: the scans that were completed; by default the `input` named in objects.json, or
            `TRACK/scans` in `folder`. Without them only the completed shapes are shown.

    Raises:
        BadInputError: no such folder, nothing to report in it, or a damaged file.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise BadInputError(f"{folder}: no such folder; name the --out of an earlier command.")
    metrics = [(path, _json(path)) for path in _find(folder, "metrics.json")]
    curves = [curve for log in _find(folder, "log.jsonl") for curve in training_curves(log)]
    tracks = [path.parent for path in _find(folder, "completed")]
    if not (metrics or curves or tracks):
        raise BadInputError(
            f"{folder}: holds no completed/, metrics.json or log.jsonl to report; run complete, "
            "evaluate or train with --out first."
        )
    return Report(
        title=f"Wildshape report: {folder.resolve().name}",
        summary=_summary(len(tracks), len(metrics), len(curves)),
        tables=tuple(metrics_table(found) for _, found in metrics),
        curves=tuple(curves),
        objects=tuple(_object(track, inputs) for track in tracks[:MAX_OBJECTS]),
        notes=_notes(tracks),
        provenance=_provenance(metrics),
        figures=tuple(_figure(file) for path, _ in metrics for file in _pictures(path)),
    )


def _find(folder: Path, name: str) -> list[Path]:
    found = {path for depth in ("", "*/", "*/*/") for path in folder.glob(f"{depth}{name}")}
    return sorted(found)


def _json(path: Path) -> dict[str, Any]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInputError(
            f"{path}: expected JSON, found {error}; write it again with the command that made it."
        ) from error
    return data if isinstance(data, dict) else {"objects": data}


def _pictures(metrics: Path) -> list[Path]:
    return sorted(metrics.parent.glob("*.png"))


def _figure(picture: Path) -> Figure:
    return Figure(picture.stem.replace("_", " "), picture.read_bytes())


def _summary(tracks: int, metrics: int, curves: int) -> str:
    counted = ((tracks, "completed track"), (metrics, "evaluation"), (curves, "training curve"))
    parts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in counted if n]
    return f"Found here: {', '.join(parts)}."


def _notes(tracks: list[Path]) -> tuple[str, ...]:
    more = len(tracks) - MAX_OBJECTS
    return (f"{more} more tracks are in the folder and not drawn here.",) if more > 0 else ()


def _provenance(metrics: list[tuple[Path, dict[str, Any]]]) -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for _, found in metrics:
        merged.update(found.get("provenance") or {})
    return merged


def _object(folder: Path, inputs: Path | None) -> ReportObject:
    """One track: its middle scan completed, and all scans fused where they can be found."""
    path = folder / "objects.json"
    found = _json(path) if path.exists() else {}
    track = _input_track(folder, found, inputs)
    completed = sorted((folder / "completed").glob("*.ply"))
    if track is None:
        return _completed_only(folder, found, completed)
    name = track.scan_names[track.middle]
    scan = folder / "completed" / f"{name}.ply"
    entry = _entry(found, name, track.middle)
    return track_object(
        track,
        completed=read_points(scan) if scan.exists() else None,
        box=_box(entry),
        T_middle_scan=_registered(folder / "poses.txt", track),
        facts=_facts(entry),
    )


def _completed_only(folder: Path, found: dict[str, Any], completed: list[Path]) -> ReportObject:
    if not completed:
        return ReportObject(folder.name, "no completed scan")
    middle = len(completed) // 2
    scan = completed[middle]
    entry = _entry(found, scan.stem, middle)
    return ReportObject(
        name=folder.name,
        subtitle=f"scan {scan.stem}; the input scans were not found",
        clouds=(Cloud("completed", read_points(scan)),),
        box=_box(entry),
        facts=tuple(_facts(entry)),
    )


def _input_track(folder: Path, found: dict[str, Any], inputs: Path | None) -> Track | None:
    named = found.get("input")
    places = (inputs, Path(named) if isinstance(named, str) else None, folder)
    for place in places:
        if place is None or not place.exists():
            continue
        if place == folder and not (folder / "scans").is_dir():
            continue
        source = open_tracks(place)
        index = _index(source, folder.name)
        if index is not None:
            return source[index]
    return None


def _index(source: TrackSource, name: str) -> int | None:
    if name in source.names:
        return source.names.index(name)
    return 0 if len(source.names) == 1 else None


def _registered(path: Path, track: Track) -> SE3 | None:
    """`T_middle_scan = T_middle_can inv(T_scan_can)`, METHOD 7; None without a pose a scan."""
    if not path.exists():
        return None
    T_sensor_can = read_poses(path)
    if len(T_sensor_can) != len(track.scans) or len(track.scans) < 2:
        return None
    return T_sensor_can[track.middle] @ T_sensor_can.inverse()


def _entry(found: dict[str, Any], name: str, index: int) -> dict[str, Any]:
    """The entry of a scan in objects.json, by its name, else by its place."""
    entries = list(_scan_entries(found))
    for entry in entries:
        if str(entry.get("scan", entry.get("name", ""))) == name:
            return entry
    return entries[index] if index < len(entries) else {}


def _scan_entries(found: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for value in (found.get("scans"), found.get("objects")):
        if isinstance(value, list):
            yield from (entry for entry in value if isinstance(entry, dict))
        if isinstance(value, dict):
            yield from ({"scan": k, **v} for k, v in value.items() if isinstance(v, dict))


def _box(entry: dict[str, Any]) -> Box | None:
    raw = entry.get("box")
    if not isinstance(raw, dict):
        return None
    center = raw.get("center", raw.get("centre"))
    quaternion = raw.get("quaternion_wxyz", raw.get("quaternion"))
    if center is None or quaternion is None or raw.get("size") is None:
        return None
    x, y, z = (float(v) for v in center)
    length, width, height = (float(v) for v in raw["size"])
    qw, qx, qy, qz = (float(v) for v in quaternion)
    return Box((x, y, z), (length, width, height), (qw, qx, qy, qz))


def _facts(entry: dict[str, Any]) -> list[tuple[str, str]]:
    facts = []
    box = _box(entry)
    if isinstance(entry.get("confidence"), int | float):
        facts.append(("confidence", f"{entry['confidence']:.2f}"))
    if box is not None:
        facts.append(("box", " x ".join(f"{side:.2f}" for side in box.size) + " m"))
    if entry.get("refined") is not None:
        facts.append(("refined", "yes" if entry["refined"] else "no"))
    if isinstance(entry.get("seconds"), int | float):
        facts.append(("time", f"{1000 * entry['seconds']:.0f} ms"))
    if entry.get("warning"):
        facts.append(("warning", str(entry["warning"])))
    return facts
