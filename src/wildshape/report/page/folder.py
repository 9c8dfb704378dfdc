# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A report of whatever `complete`, `register`, `train` and evaluations left in a folder.

Looked for in the folder and two levels below: metrics.json with the figures beside it, log.jsonl,
wildshape.json, and track folders with objects.json, completed/, poses.txt. What is absent is left
out.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.registration import to_middle
from wildshape.io.guard import read_json, reading
from wildshape.records import Track, as_text
from wildshape.report.content import Cloud, Curve, Figure, Report, ReportObject, Table, track_object
from wildshape.report.page.curves import training_curves
from wildshape.report.page.metrics import (
    is_ours,
    metrics_table,
    of_confidences,
    of_errors,
    of_metrics,
    of_run,
)
from wildshape.report.page.ranking import (
    Judged,
    index_of,
    judge,
    objects_of_scores,
    scans_of,
    worst_first,
)
from wildshape.report.results import (
    MARKER,
    METRICS,
    OBJECTS,
    PROBABILITIES,
    SCORES,
    Inputs,
    TrackResult,
    box_of,
    doubt_of,
    find,
    read_result,
)

MAX_OBJECTS, MAX_JUDGED = 24, 1000
_LABELS = {"seconds": "time", **PROBABILITIES}


class Evaluation(NamedTuple):
    """What an evaluation left.

    Attributes:
        path: of its metrics.json.
        which: its place in the folder, to begin titles with; empty where it is the only one.
    """

    path: Path
    metrics: dict[str, Any]
    which: str


def _curves(folder: Path) -> list[Curve]:
    """Of all runs; where there are several, each curve says of which it is."""
    logs = find(folder, "log.jsonl")
    if len(logs) < 2:
        return [curve for log in logs for curve in training_curves(log)]
    runs = [(as_text(str(log.parent.relative_to(folder))), training_curves(log)) for log in logs]
    return [replace(one, title=f"{run}: {one.title}") for run, curves in runs for one in curves]


def report_from_folder(folder: Path, inputs: Path | None = None) -> Report:
    """What a folder holds, as a report: the objects to worry about first.

    Args:
        folder: the `--out` of one or several commands.
        inputs: the scans that were completed, if they have moved from where objects.json says.
            Where one cannot be read only the completed shape is shown.

    Raises:
        BadInputError: no such folder, nothing to report in it, no scans at `inputs`, or a damaged
            file.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise BadInputError(f"{folder}: no such folder; name the --out of an earlier command.")
    evaluations = _evaluations(folder)
    curves = _curves(folder)
    tracks = [path.parent for path in find(folder, OBJECTS)]
    if not (evaluations or curves or tracks):
        raise BadInputError(
            f"{folder}: holds no objects.json, metrics.json or log.jsonl to report; run complete, "
            "evaluate or train with --out first."
        )
    where = Inputs(inputs)
    where.check(tracks)
    ranked = worst_first(_judged(track, where) for track in tracks[:MAX_JUDGED])
    drawn = ranked[:MAX_OBJECTS]
    return Report(
        title=f"Wildshape report: {as_text(folder.resolve().name)}",
        summary=_summary(folder, evaluations, len(tracks), len(curves)),
        findings=tuple(_findings(evaluations, ranked)),
        tables=tuple(map(_checked_table, evaluations)),
        index=tuple(_index(ranked, len(drawn), evaluations)),
        curves=tuple(curves),
        objects=tuple(_checked_object(one, where) for one in drawn),
        notes=tuple(_notes(len(tracks), len(drawn))),
        provenance=_provenance(folder, evaluations),
        figures=tuple(picture for one in evaluations for picture in _pictures(one)),
    )


def _evaluations(folder: Path) -> list[Evaluation]:
    paths = find(folder, METRICS)
    places = {path: path.parent.relative_to(folder) for path in paths}
    names = {
        path: as_text(str(at) if at.parts else folder.resolve().name) for path, at in places.items()
    }
    several = len(paths) > 1
    found = [(p, read_json(p, "what evaluate writes", dict)) for p in paths]
    return [Evaluation(p, said, f"{names[p]}: " if several else "") for p, said in found]


def _judged(folder: Path, where: Inputs) -> Judged:
    """`judge`, a damaged objects.json named."""
    with reading(folder / OBJECTS, "what complete or register writes"):
        return judge(read_result(folder, where))


def _pictures(of: Evaluation) -> Iterator[Figure]:
    for file in sorted(of.path.parent.glob("*.png")):
        wide = file.stem != "confidence"  # several panels side by side
        yield Figure(f"{of.which}{file.stem.replace('_', ' ')}", file.read_bytes(), wide)


def _summary(folder: Path, evaluations: list[Evaluation], tracks: int, curves: int) -> str:
    """What there is, and the commands that made it."""
    counted = ((tracks, "track"), (len(evaluations), "evaluation"), (curves, "training curve"))
    parts = [f"{n} {what}{'s' if n > 1 else ''}" for n, what in counted if n]
    records = _records(folder, evaluations)
    runs = dict.fromkeys(line for record in records if (line := _of_run(*record)))
    return "\n\n".join((f"Found here: {', '.join(parts)}.", *runs))


def _of_run(path: Path, record: dict[str, Any]) -> str:
    """`of_run`, a damaged record named."""
    with reading(path, "what a command says of itself"):
        return of_run(record)


def _records(folder: Path, evaluations: list[Evaluation]) -> list[tuple[Path, dict[str, Any]]]:
    """What each command's output says of itself."""
    said = "what a command says of itself"
    markers = [(path, read_json(path, said, dict)) for path in find(folder, MARKER)]
    return markers + [(one.path, one.metrics) for one in evaluations]


def _findings(evaluations: list[Evaluation], ranked: Sequence[Judged]) -> Iterator[str]:
    for one in evaluations:
        with reading(one.path, "what evaluate writes"):
            yield from (f"{one.which}{line}" for line in of_metrics(one.metrics))
    yield from of_errors(
        [one.cd for one in ranked if one.cd is not None],
        [one.rotation_deg for one in ranked if one.rotation_deg is not None],
    )
    entries = [entry for one in ranked for entry in one.result.entries]
    known = [float(e["confidence"]) for e in entries if e.get("confidence") is not None]
    yield from of_confidences(known, sum(bool(doubt_of(entry)) for entry in entries))


def _index(ranked: Sequence[Judged], drawn: int, evaluations: list[Evaluation]) -> Iterator[Table]:
    if ranked:
        yield index_of(ranked, drawn)
    for one in evaluations:
        scores = one.path.with_name(SCORES)
        ours = next((name for name in one.metrics.get("methods") or () if is_ours(name)), None)
        table = objects_of_scores(scores, ours) if ours and scores.is_file() else None
        if table is not None:
            yield replace(table, title=f"{one.which}{table.title}")


def _notes(tracks: int, drawn: int) -> Iterator[str]:
    if tracks > MAX_JUDGED:
        yield f"{tracks - MAX_JUDGED} more tracks are in the folder and were not looked at."
    if min(tracks, MAX_JUDGED) > drawn:
        yield f"Of {min(tracks, MAX_JUDGED)} objects the {drawn} to look at first are drawn."


def _provenance(folder: Path, evaluations: list[Evaluation]) -> dict[str, Any]:
    """Of each command's output, under its place in the folder."""
    return {
        str(path.relative_to(folder)): found["provenance"]
        for path, found in _records(folder, evaluations)
        if found.get("provenance")
    }


def _checked_table(one: Evaluation) -> Table:
    """`metrics_table`, a damaged metrics.json named."""
    with reading(one.path, "what evaluate writes"):
        table = metrics_table(one.metrics)
        return replace(table, title=f"{one.which}{table.title}")


def _checked_object(judged: Judged, where: Inputs) -> ReportObject:
    """`_object`, a damaged objects.json named."""
    folder = judged.result.folder
    with reading(folder / OBJECTS, "what complete or register writes"):
        return _object(judged, read_result(folder, where))


def _object(judged: Judged, result: TrackResult) -> ReportObject:
    """One track: its middle scan completed, and all scans fused where they can be read."""
    track = result.track
    if track is None:
        return _completed_only(result)
    name = track.scan_names[track.middle]
    entry, T_middle_scan = result.entry(name), _registered(result, track)
    shown = track_object(
        track,
        completed=result.completed(name),
        box=box_of(entry),
        fused={} if T_middle_scan is None else {"fused by us": T_middle_scan},
        details=(*_errors(judged), *_details(entry)),
    )
    return replace(shown, scans=scans_of(result))


def _completed_only(result: TrackResult) -> ReportObject:
    completed = result.completed_scans()
    missing = "the input scans cannot be read by their names, or changed since; --inputs names them"
    if not completed:
        return ReportObject(result.folder.name, missing, scans=scans_of(result))
    scan = completed[len(completed) // 2]
    shape, entry = result.completed(scan), result.entry(scan)
    return ReportObject(
        name=result.folder.name,
        subtitle=f"scan {scan}; {missing}",
        clouds=() if shape is None else (Cloud("completed", shape),),
        box=box_of(entry),
        details=_details(entry),
        sensor=result.sensor,
        scans=scans_of(result),
    )


def _registered(result: TrackResult, track: Track) -> SE3 | None:
    """`T_middle_scan = T_middle_can inv(T_scan_can)`, METHOD 7; None without a pose a scan."""
    T_sensor_can = result.poses() if len(track.scans) > 1 else None
    if T_sensor_can is None or len(T_sensor_can) != len(track.scans):
        return None
    return to_middle(T_sensor_can)


def _errors(judged: Judged) -> tuple[tuple[str, str], ...]:
    known = (
        ("CD to truth", judged.cd, "{:.3f} m"),
        ("median pose error", judged.rotation_deg, "{:.1f}°"),
    )
    return tuple((label, text.format(value)) for label, value, text in known if value is not None)


def _details(entry: dict[str, Any]) -> tuple[tuple[str, str], ...]:
    known = {
        **dict.fromkeys(("confidence", *PROBABILITIES), lambda value: f"{value:.2f}"),
        "box": lambda box: " x ".join(f"{side:.2f}" for side in box["size"]) + " m",
        "refined": lambda value: "yes" if value else "no",
        "seconds": lambda value: f"{1000 * value:.0f} ms",
        "warning": str,
        "reasons": ", ".join,
    }
    wanted = [key for key in known if entry.get(key) not in (None, "", [])]
    return tuple((_LABELS.get(key, key), known[key](entry[key])) for key in wanted)
