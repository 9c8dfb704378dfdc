# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where the error lies: an evaluation of simulated drives, told apart by kind of vehicle."""

import json
from dataclasses import replace
from pathlib import Path

from experiments.tables.measure import as_results

from wildshape.evaluation.results import Limits, MethodScores, pooled
from wildshape.evaluation.summary import FIGURES, figures_of
from wildshape.evaluation.tables import cell, pipe_table
from wildshape.io.store.store import open_store

_SHOWN = ("cd", "precision", "coverage", "acc30", "rot_median_deg", "trans_median_m")
_COLUMNS = [figure for figure in FIGURES if figure.name in _SHOWN]


def table(data: Path, evaluation: Path, method: str = "wildshape") -> str:
    """A row a kind, as markdown; each has the figures that the evaluation has of all.

    Args:
        data: simulated tracks, as a packed store.
        evaluation: folder that `wildshape evaluate` wrote for them.
        method: row to look at.
    """
    words = {track.name: track.source.split()[-1] for track in open_store(data)}
    kinds = {name: word.split("_")[0] for name, word in words.items()}  # of meshes, the category
    scores = _scores(evaluation / "scores.json", method)
    parts = {kind: _of_kind(scores, kinds, kind) for kind in sorted({*kinds.values()})}
    scans = {kind: sum(row.scans for row in part.completions) for kind, part in parts.items()}
    rows = []
    for kind in sorted((kind for kind in parts if scans[kind]), key=lambda kind: -scans[kind]):
        figures = figures_of(parts[kind])
        cells = (cell(figures[column.name], None, column) for column in _COLUMNS)
        rows.append([kind, str(scans[kind]), *cells])
    return pipe_table(["kind", "scans", *(column.heading for column in _COLUMNS)], rows)


def _scores(path: Path, method: str) -> MethodScores:
    """One row, all seeds together."""
    runs = json.loads(path.read_text("utf-8"))["runs"]
    methods = pooled([as_results(run, Limits()) for run in runs]).methods
    return next(row for row in methods if row.name == method)


def _of_kind(scores: MethodScores, kinds: dict[str, str], kind: str) -> MethodScores:
    return replace(
        scores,
        completions=tuple(row for row in scores.completions if kinds[row.track] == kind),
        registrations=tuple(row for row in scores.registrations if kinds[row.track] == kind),
    )
