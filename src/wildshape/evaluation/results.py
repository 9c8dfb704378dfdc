# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What an evaluation found: one record a scan, their summaries, and `metrics.json`."""

import os
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from wildshape.evaluation.boxes import BoxScore, box_figures
from wildshape.evaluation.confidence import confidence_figures, risk_coverage_curves
from wildshape.evaluation.metrics import ACCURATE_DEG, NAMES, UNITS, CompletionError
from wildshape.evaluation.skipped import Skipped, by_reason, with_rows
from wildshape.evaluation.turning import Rotate
from wildshape.io.atomic import write_json

FORMAT = 1
Figures = dict[str, float | None]


@dataclass(frozen=True)
class CompletionScore:
    """One completed scan, or one track completed as a whole (then `scan` is its middle one).

    Attributes:
        track: name.
        scan: name.
        error: against the shape, or the mirrored accumulation where the shape is not known.
        error_partial: against the accumulation as it is; None where the shape is known.
        truth: `shape` or `mirrored`.
        points: of the prediction.
        truth_points: of the truth.
        cd_floor: CD of perfect points as many as these, metres (METHOD 8).
        partial_points: of the accumulation as it is; None where the shape is known.
        confidence: 0 to 1, as the method states it; None if it states none.
        box: of the object, if the method draws one.
    """

    track: str
    scan: str
    error: CompletionError
    error_partial: CompletionError | None
    truth: str
    points: int
    truth_points: int
    cd_floor: float
    partial_points: int | None = None
    confidence: float | None = None
    box: BoxScore | None = None


@dataclass(frozen=True)
class RegistrationScore:
    """One scan registered to its track's middle scan; see `RegistrationError`."""

    track: str
    scan: str
    rotation_deg: float
    rotation_sym_deg: float
    translation_m: float


@dataclass(frozen=True)
class MethodScores:
    """One method under one seed.

    Attributes:
        name: of its row.
        completions: one a scan, or one a track.
        registrations: one a scan.
        skipped: what counted in neither.
        about: method and settings in a line, if it says.
    """

    name: str
    completions: tuple[CompletionScore, ...]
    registrations: tuple[RegistrationScore, ...]
    skipped: tuple[Skipped, ...]
    about: str = ""


@dataclass(frozen=True)
class Results:
    """One run of the protocol."""

    rotate: Rotate
    seed: int
    methods: tuple[MethodScores, ...]

    def __getitem__(self, name: str) -> MethodScores:
        return next(scores for scores in self.methods if scores.name == name)


@dataclass(frozen=True)
class Summary:
    """One row of the table.

    Attributes:
        name: of the method.
        truth: what completions were measured against, in a word.
        per_seed: the figures of each seed, keyed by `NAMES`; None where there is none.
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


def figures_of(scores: MethodScores) -> Figures:
    """The figures of one method under one seed; means for clouds, medians for poses."""
    return {**dict.fromkeys(NAMES), **_completion_figures(scores), **_pose_figures(scores)}


def _completion_figures(scores: MethodScores) -> Figures:
    rows = scores.completions
    if not rows:
        return {}
    partial = [row.error_partial for row in rows if row.error_partial is not None]
    return {
        **_errors([row.error for row in rows], ""),
        **_errors(partial, "_partial"),
        "cd_floor": float(np.mean([row.cd_floor for row in rows])),
        "points": float(np.median([row.points for row in rows])),
        "truth_points": float(np.median([row.truth_points for row in rows])),
        "partial_points": _median([row.partial_points for row in rows]),
        **confidence_figures(stated(rows)),
        **box_figures([row.box for row in rows if row.box is not None]),
    }


def stated(rows: Sequence[CompletionScore]) -> tuple[list[float], list[float]]:
    """Confidences, where one is stated, and the Chamfer distances that belong to them, metres."""
    pairs = [(row.confidence, row.error.cd) for row in rows if row.confidence is not None]
    return [sure for sure, _ in pairs], [cd for _, cd in pairs]


def _median(counts: Sequence[int | None]) -> float | None:
    known = [count for count in counts if count is not None]
    return float(np.median(known)) if known else None


def _errors(errors: Sequence[CompletionError], suffix: str) -> Figures:
    if not errors:
        return {}
    return {
        f"{name}{suffix}": float(np.mean([getattr(error, name) for error in errors]))
        for name in ("cd", "precision", "coverage")
    }


def _pose_figures(scores: MethodScores) -> Figures:
    rows = scores.registrations
    if not rows:
        return {}
    rotation = np.asarray([row.rotation_deg for row in rows])
    symmetric = np.asarray([row.rotation_sym_deg for row in rows])
    return {
        "acc30": float((rotation <= ACCURATE_DEG).mean()),
        "rot_median_deg": float(np.median(rotation)),
        "trans_median_m": float(np.median([row.translation_m for row in rows])),
        "acc30_sym": float((symmetric <= ACCURATE_DEG).mean()),
        "rot_sym_median_deg": float(np.median(symmetric)),
    }


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
        mean={key: _over_seeds(per_seed, key, spread=False) for key in NAMES},
        std={key: _over_seeds(per_seed, key, spread=True) for key in NAMES},
        completions=sum(len(s.completions) for s in scores.values()),
        registrations=sum(len(s.registrations) for s in scores.values()),
        skipped=by_reason(one for s in scores.values() for one in s.skipped),
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
        "units": UNITS,
        "provenance": {**_machine(), **provenance},
        "methods": {summary.name: _method_json(summary) for summary in summarise(runs)},
        "risk_coverage": risk_coverage_curves(
            (s.name, stated(s.completions)) for run in runs for s in run.methods
        ),
        "skipped": with_rows((s.name, one) for r in runs for s in r.methods for one in s.skipped),
    }


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
