# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The figures of a table, their means over seeds, `metrics.json` and `scores.json`.

A figure is a line of `FIGURES`: tables, JSON and the report take it from there.
"""

import os
import platform
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from wildshape.evaluation.calibration import HEADING_DEG, LEAST_BEV, Held, calibration
from wildshape.evaluation.metrics import ACCURATE_DEG, BoxScore
from wildshape.evaluation.results import CompletionScore, MethodScores, Results, Skipped
from wildshape.evaluation.risk_coverage import RiskCoverage, rank_correlation, risk_coverage
from wildshape.io.atomic import write_json

FORMAT = 1
Figures = dict[str, float | None]
Statistic = Callable[[list[Any]], Any]
Of = Callable[[MethodScores], float | None]


@dataclass(frozen=True)
class Figure:
    """One figure of a method.

    Attributes:
        name: its key in `metrics.json`.
        unit: in words.
        of: the figure of a method's scores under one seed; None where there is none.
        heading: of its column in tables; empty where it is no column.
        digits: after the point, in tables.
        factor: by which tables multiply it: 100 for percent.
    """

    name: str
    unit: str
    of: Of
    heading: str = ""
    digits: int = 3
    factor: int = 1


def _scans(statistic: Statistic, path: str) -> Of:
    """A statistic of a part of each completed scan's record, of those that have it.

    A track's one cloud counts as often as it has scans, as the clouds beside it do.
    """
    return lambda scores: _of(
        statistic, (_part(row, path) for row in scores.completions for _ in range(row.scans))
    )


def _poses(statistic: Statistic, path: str) -> Of:
    """A statistic of a part of each registered scan's record."""
    return lambda scores: _of(statistic, (_part(row, path) for row in scores.registrations))


def _of(statistic: Statistic, values: Iterable[float | int | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(statistic(known)) if known else None


def _part(row: Any, path: str) -> float | int | None:
    for name in path.split("."):
        row = None if row is None else getattr(row, name)
    return row


def _accurate(degrees: list[float]) -> float:
    return float((np.asarray(degrees) <= ACCURATE_DEG).mean())


def _accurate_headings(degrees: list[float]) -> float:
    """Share of headings within 30 degrees of the front, or of the rear if that is more.

    Which end of the canonical frame is the front is nobody's definition, but it is one end for all
    objects: the better one is chosen once for the whole row.
    """
    return max(_accurate(degrees), _accurate([180 - one for one in degrees]))


def _held(kind: Literal["pose", "box"], part: str) -> Of:
    """A number of how well the stated probabilities of headings or boxes held."""

    def of(scores: MethodScores) -> float | None:
        held = held_of([scores], kind)
        return None if held is None else getattr(held, part)

    return of


def _figures_of_trust(kind: Literal["pose", "box"]) -> Iterator[Figure]:
    yield Figure(f"p_{kind}_error", _CALIBRATED, _held(kind, "error"))
    yield Figure(f"p_{kind}_brier", "mean squared error, 0 to 1", _held(kind, "brier"))
    yield Figure(
        f"p_{kind}_brier_constant", "the same of the best constant", _held(kind, "constant")
    )


def held_of(runs: Sequence[MethodScores], kind: Literal["pose", "box"]) -> Held | None:
    """How well stated probabilities held, over all runs together; None where none are stated."""
    rows = [(row, row.box) for scores in runs for row in scores.completions]
    known = [(getattr(row, f"p_{kind}"), box) for row, box in rows if box is not None]
    pairs = [(stated, box) for stated, box in known if stated is not None]
    boxes = [box for _, box in pairs]
    true = headings_right(boxes) if kind == "pose" else [box.bev >= LEAST_BEV for box in boxes]
    return calibration([stated for stated, _ in pairs], true)


def headings_right(boxes: Sequence[BoxScore]) -> list[bool]:
    """Which headings are within 10 degrees of one end, the same for all: the better one."""
    ends = (
        [box.heading_deg <= HEADING_DEG for box in boxes],
        [180 - box.heading_deg <= HEADING_DEG for box in boxes],
    )
    return max(ends, key=sum)


_CALIBRATED = "stated less true share, mean over five bins of equal count"
_METRES, _DEGREES, _SHARE, _COUNT = "metres", "degrees", "share, 0 to 1", "points"
_STD = "sample standard deviation over seeds; null for one seed"
FIGURES = (
    Figure("cd", _METRES, _scans(np.mean, "error.cd"), "CD, m"),
    Figure("precision", _METRES, _scans(np.mean, "error.precision"), "precision"),
    Figure("coverage", _METRES, _scans(np.mean, "error.coverage"), "coverage"),
    Figure("cd_partial", _METRES, _scans(np.mean, "error_partial.cd"), "CD partial"),
    Figure("precision_partial", _METRES, _scans(np.mean, "error_partial.precision")),
    Figure("coverage_partial", _METRES, _scans(np.mean, "error_partial.coverage")),
    Figure("points", _COUNT, _scans(np.median, "points"), "points", 0),
    Figure("cd_floor", _METRES, _scans(np.mean, "cd_floor"), "CD floor"),
    Figure("acc30", _SHARE, _poses(_accurate, "rotation_deg"), "acc 30, %", 1, 100),
    Figure("rot_median_deg", _DEGREES, _poses(np.median, "rotation_deg"), "rot, deg", 2),
    Figure("trans_median_m", _METRES, _poses(np.median, "translation_m"), "trans, m"),
    Figure("acc30_sym", _SHARE, _poses(_accurate, "rotation_sym_deg"), "acc 30 sym, %", 1, 100),
    Figure(
        "rot_sym_median_deg", _DEGREES, _poses(np.median, "rotation_sym_deg"), "rot sym, deg", 2
    ),
    Figure("box_iou", "shared over joint volume, 0 to 1", _scans(np.mean, "box.iou"), "box IoU"),
    Figure(
        "box_bev",
        "shared over joint area, 0 to 1",
        _scans(np.mean, "box.bev"),
        "BEV IoU",
    ),
    Figure("box_length_bias_m", _METRES, _scans(np.mean, "box.length_off_m")),
    Figure("box_width_bias_m", _METRES, _scans(np.mean, "box.width_off_m")),
    Figure("box_height_bias_m", _METRES, _scans(np.mean, "box.height_off_m")),
    Figure(
        "heading30", _SHARE, _scans(_accurate_headings, "box.heading_deg"), "heading 30, %", 1, 100
    ),
    Figure(
        "heading30_sym",
        _SHARE,
        _scans(_accurate, "box.heading_sym_deg"),
        "heading 30 sym, %",
        1,
        100,
    ),
    Figure("heading_sym_median_deg", _DEGREES, _scans(np.median, "box.heading_sym_deg")),
    Figure("truth_points", _COUNT, _scans(np.median, "truth_points")),
    Figure("partial_points", _COUNT, _scans(np.median, "partial_points")),
    Figure(
        "confidence_rank_correlation",
        "Spearman, doubt with cd: 1 orders perfectly, 0 by chance",
        lambda scores: rank_correlation(*stated(scores.completions)),
    ),
    Figure(
        "risk_coverage_area",
        "metres of cd, over the share of the surest scans",
        lambda scores: curve.area if (curve := curve_of([scores])) else None,
    ),
    *_figures_of_trust("pose"),
    *_figures_of_trust("box"),
)


def figures_of(scores: MethodScores) -> Figures:
    """The figures of one method under one seed; means for clouds, medians for poses."""
    return {figure.name: figure.of(scores) for figure in FIGURES}


def stated(rows: Sequence[CompletionScore]) -> tuple[list[float], list[float]]:
    """Confidences, where one is stated, and the Chamfer distances that belong to them, metres."""
    pairs = [(row.confidence, row.error.cd) for row in rows if row.confidence is not None]
    return [sure for sure, _ in pairs], [cd for _, cd in pairs]


def curve_of(runs: Sequence[MethodScores]) -> RiskCoverage | None:
    """Risk over coverage of a method that states confidences, over all its runs together."""
    return risk_coverage(*stated([row for scores in runs for row in scores.completions]))


@dataclass(frozen=True)
class Summary:
    """One row of the table.

    Attributes:
        truth: what completions were measured against, in a word.
        per_seed: the figures of each seed, keyed by name; None where there is none.
        mean: over the seeds.
        std: over the seeds; None for a single one.
        completions: scans (or whole tracks) counted, all seeds together.
        registrations: scans counted, all seeds together.
        skipped: scans left out by reason, all seeds together.
        about: method and settings in a line, if it says.
    """

    name: str
    truth: str
    per_seed: dict[int, Figures]
    mean: Figures
    std: Figures
    completions: int
    registrations: int
    skipped: dict[str, int]
    about: str


def summarise(runs: Sequence[Results]) -> list[Summary]:
    """One summary a method over runs that differ in their seed only."""
    names = list(dict.fromkeys(scores.name for run in runs for scores in run.methods))
    return [_summary(name, runs) for name in names]


def _summary(name: str, runs: Sequence[Results]) -> Summary:
    scores = {run.seed: s for run in runs for s in run.methods if s.name == name}
    per_seed = {seed: figures_of(s) for seed, s in scores.items()}
    truths = sorted({row.truth for s in scores.values() for row in s.completions})
    return Summary(
        name=name,
        truth=" and ".join(truths),
        per_seed=per_seed,
        mean={f.name: _over_seeds(per_seed, f.name, spread=False) for f in FIGURES},
        std={f.name: _over_seeds(per_seed, f.name, spread=True) for f in FIGURES},
        completions=sum(len(s.completions) for s in scores.values()),
        registrations=sum(len(s.registrations) for s in scores.values()),
        skipped=dict(Counter(one.reason for s in scores.values() for one in s.skipped)),
        about=next((s.about for s in scores.values() if s.about), ""),
    )


def _over_seeds(per_seed: Mapping[int, Figures], key: str, *, spread: bool) -> float | None:
    values = [figure for f in per_seed.values() if (figure := f[key]) is not None]
    if len(values) < (2 if spread else 1):
        return None
    return float(np.std(values, ddof=1)) if spread else float(np.mean(values))


def as_json(runs: Sequence[Results], provenance: Mapping[str, object]) -> dict[str, object]:
    """The content of `metrics.json`: each method's figures as means over seeds, and the details."""
    return {
        "format": FORMAT,
        "rotate": runs[0].rotate,
        "seeds": [run.seed for run in runs],
        "limits": asdict(runs[0].limits),
        "units": {**{figure.name: figure.unit for figure in FIGURES}, "std": _STD},
        "provenance": {**_machine(), **provenance},
        "methods": {summary.name: _method_json(summary) for summary in summarise(runs)},
        "risk_coverage": _curves(runs),
        "skipped": _skipped(runs),
    }


def _curves(runs: Sequence[Results]) -> dict[str, dict[str, object]]:
    rows: dict[str, list[MethodScores]] = {}
    for scores in (scores for run in runs for scores in run.methods):
        rows.setdefault(scores.name, []).append(scores)
    curves = {name: curve_of(found) for name, found in rows.items()}
    return {name: asdict(curve) for name, curve in curves.items() if curve is not None}


def _skipped(runs: Sequence[Results]) -> list[dict[str, object]]:
    """Every scan left out, once a reason, with the rows of the table that it is missing from."""
    rows: dict[Skipped, dict[str, None]] = {}
    for scores in (scores for run in runs for scores in run.methods):
        for one in scores.skipped:
            rows.setdefault(one, {})[scores.name] = None
    return [{**asdict(one), "methods": list(names)} for one, names in rows.items()]


def _method_json(summary: Summary) -> dict[str, object]:
    return {
        **summary.mean,
        "about": summary.about,
        "std": summary.std,
        "per_seed": {str(seed): figures for seed, figures in summary.per_seed.items()},
        "truth": summary.truth,
        "scans_counted": {
            "completion": summary.completions,
            "registration": summary.registrations,
        },
        "scans_skipped": summary.skipped,
    }


def _machine() -> dict[str, object]:
    return {
        "wildshape": version("wildshape"),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": platform.machine(),
        "cores": os.cpu_count(),
    }


def write_metrics(
    folder: Path, runs: Sequence[Results], provenance: Mapping[str, object] | None = None
) -> Path:
    """Write `metrics.json` into `folder`, atomically.

    Args:
        folder: made if missing.
        runs: at least one, of one input protocol, one a seed.
        provenance: data, models, commands, commit: whatever says how the figures came about.
    """
    path = folder / "metrics.json"
    write_json(path, as_json(runs, provenance or {}))
    return path


def write_scores(folder: Path, runs: Sequence[Results]) -> Path:
    """Write `scores.json`, every scan's record behind the figures, atomically."""
    path = folder / "scores.json"
    write_json(path, {"runs": [asdict(run) for run in runs]})
    return path
