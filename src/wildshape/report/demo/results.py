# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the demo measures, makes of unseen scans, says and draws."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.named import baseline
from wildshape.baselines.pairs import Chained
from wildshape.evaluation.evaluate import evaluate_once, write_evaluation
from wildshape.evaluation.examples import pick
from wildshape.evaluation.results import Results
from wildshape.evaluation.summary import as_json, figures_of
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.folders.complete_folder import FILES, write_results
from wildshape.inference.predictor import Predictor
from wildshape.inference.registration import fuse_scans
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.output import Output, begin
from wildshape.io.progress import Progress, duration
from wildshape.io.scans.writers import write_cloud
from wildshape.records import Completion, Track
from wildshape.report.content import Cloud, Report, ReportObject, track_object
from wildshape.report.demo.drive import DemoDrive
from wildshape.report.demo.tracks import TEST, DemoData
from wildshape.report.page.curves import training_curves
from wildshape.report.page.html import write_report
from wildshape.report.page.metrics import metrics_table

_PROTOCOLS: tuple[Literal["yaw", "none"], ...] = ("yaw", "none")
_BASELINES, _MAX_SCANS, _SHOWN = ("identity", "local-icp", "one-scan"), 6, 3


def evaluate(out: Path, models: Mapping[str, Predictor], progress: Progress) -> dict[str, Results]:
    """Baselines and models on the test tracks, turned in yaw and as recorded; by protocol."""
    source = open_tracks(out / TEST)
    ours = {name: Learned(predictor) for name, predictor in models.items()}
    methods = {**{name: baseline(name) for name in _BASELINES}, **ours}
    drawn = next(iter(ours.items()))
    found = {}
    for rotate in _PROTOCOLS:
        found[rotate] = evaluate_once(source, methods, rotate, 0, _MAX_SCANS, progress)
        folder = out / "evaluation" / rotate
        write_evaluation(folder, source, [found[rotate]], drawn, {})
    return found


def process(
    out: Path,
    models: Mapping[str, Predictor],
    results: Mapping[str, Results],
    progress: Progress,
) -> list[ReportObject]:
    """Complete and register every test track with each model; fuse and draw some."""
    source = open_tracks(out / TEST)
    for name, predictor in models.items():
        folder = out / "completed" / _slug(name)
        output = begin(folder, "complete", {}, FILES, overwrite=True)
        write_results(source, predictor, output, progress=progress)
        output.finish()
    chosen = _chosen(source, results["yaw"], next(iter(models)))
    tracks = {track.name: track for _, track in source.tracks(lambda name: name not in chosen)}
    return [_object(out, tracks[name], label, models) for name, label in chosen.items()]


def _chosen(source: TrackSource, results: Results, ours: str) -> dict[str, str]:
    """Best, median and worst track by their error; the first ones where there is no truth."""
    picked = pick(results[ours])
    if not picked:
        return dict.fromkeys(source.names[:_SHOWN], "not chosen by any error")
    labels: dict[str, str] = {}
    for label, (name, cd) in picked.items():
        labels.setdefault(name, f"{label} of the test tracks, CD {cd:.3f} m")
    return labels


def _object(out: Path, track: Track, label: str, models: Mapping[str, Predictor]) -> ReportObject:
    """A track in the middle scan's frame: the last model fuses, each completes."""
    done = {
        name: next(predictor.complete_many([track.scans[track.middle]], track.sensor))
        for name, predictor in models.items()
    }
    name, predictor = list(models.items())[-1]
    T_middle_scan = predictor.register_track(track.scans, track.sensor)
    by_icp = Chained(LocalIcp()).register_track(track.scans, track.sensor)
    write_cloud(out / "fused" / f"{track.name}.ply", fuse_scans(track.scans, T_middle_scan))
    shown = track_object(
        track,
        box=done[name].box,
        fused={"fused by us": T_middle_scan, "ICP fused": by_icp},
        details=_details(label, name, done[name]),
    )
    clouds = tuple(Cloud(f"completed, {n}", d.points, "#0072b2") for n, d in done.items())
    return replace(shown, clouds=(*shown.clouds, *clouds))


def _details(label: str, name: str, done: Completion) -> list[tuple[str, str]]:
    size = " x ".join(f"{side:.2f}" for side in done.box.size)
    details = [("chosen", label), ("fused and boxed by", name), ("box", f"{size} m")]
    details.append(("confidence", f"{done.confidence:.2f}"))
    return details + ([("warning", done.warning)] if done.warning else [])


def verdict(results: Mapping[str, Results], ours: Sequence[str]) -> list[str]:
    """Each model against the two bars, as it is: registration under yaw, and CD of one scan."""
    turned = {m.name: figures_of(m) for m in results["yaw"].methods}
    lines = []
    for name in ours:
        lines += [_registration(name, turned[name], turned["identity"])]
        lines += [_completion(name, turned[name], turned["one-scan"])]
    return [line for line in lines if line]


def _registration(name: str, ours: Mapping[str, Any], identity: Mapping[str, Any]) -> str:
    if ours["acc30"] is None or identity["acc30"] is None:
        return f"{name}: no true poses, so registration could not be measured"
    better = ours["acc30"] > identity["acc30"]
    better = better and ours["rot_median_deg"] < identity["rot_median_deg"]
    return (
        f"{name}: registration of turned scans {'beats' if better else 'does NOT beat'} identity"
        f" ({100 * ours['acc30']:.0f} % within 30 degrees, median {ours['rot_median_deg']:.1f},"
        f" against {100 * identity['acc30']:.0f} % and {identity['rot_median_deg']:.1f})"
    )


def _completion(name: str, ours: Mapping[str, Any], one_scan: Mapping[str, Any]) -> str:
    if ours["cd"] is None or one_scan["cd"] is None:
        return f"{name}: no true shape, so completion could not be measured"
    better = ours["cd"] < one_scan["cd"]
    return (
        f"{name}: completion of one scan {'beats' if better else 'does NOT beat'} what ICP has of"
        " one scan"
        f" (CD {ours['cd']:.3f} m against {one_scan['cd']:.3f} m)"
    )


def draw(
    out: Path,
    output: Output,
    data: DemoData,
    shown: Sequence[ReportObject],
    results: Mapping[str, Results],
    judged: Sequence[str],
    seconds: float,
    driven: DemoDrive,
) -> Path:
    """Write `report.html`; returns its path."""
    steps, rate = _pace(out / "run" / "log.jsonl")
    tables = tuple(metrics_table(as_json([results[rotate]], {})) for rotate in _PROTOCOLS)
    report = Report(
        title="Wildshape demo",
        summary="\n\n".join(
            (
                f"Trained on {data.described} without labels, for {steps} steps; everything"
                f" below is of {data.tested}, which it has never seen.",
                *judged,
                driven.sentence,
            )
        ),
        cost=(
            ("all of it", duration(seconds)),
            ("training steps", f"{steps}"),
            ("steps a second", f"{rate:.1f}"),
            ("scans trained on", data.described.split()[0]),
        ),
        tables=tables,
        curves=training_curves(out / "run" / "log.jsonl"),
        objects=tuple(shown),
        notes=tuple(note for note in (data.note, _NOTE) if note),
        provenance=output.record["provenance"],
        figures=driven.figures,
    )
    write_report(report, out / "report.html")
    return out / "report.html"


_NOTE = (
    "Identity aligns centroids only, local-icp chains point-to-point ICP, one-scan is the scan "
    f"itself as its completion. Only {_MAX_SCANS} scans of a track count, so local-icp's steps are "
    "wider than the sensor's: with all scans it is better."
)


def _pace(log: Path) -> tuple[int, float]:
    """The last step, and the middle one of the steps a second."""
    entries = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    rates = [entry["steps_per_second"] for entry in entries if "steps_per_second" in entry]
    return entries[-1]["step"], sorted(rates)[len(rates) // 2]


def _slug(name: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in name).split())
