# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Methods measured on the tracks of an input with progress shown, and the files of a result."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from wildshape.datasets.tracks.truth import misplaced
from wildshape.evaluation.examples import gather
from wildshape.evaluation.method import Method
from wildshape.evaluation.protocol import run as run_protocol
from wildshape.evaluation.results import Limits, Results, Rotate, Skipped, pooled
from wildshape.evaluation.summary import write_metrics, write_scores
from wildshape.evaluation.tables import markdown, write_table
from wildshape.io.inputs import TrackSource
from wildshape.io.progress import SILENT, Progress
from wildshape.parallel.team import ALONE, Team
from wildshape.records import Track


def evaluate_once(
    source: TrackSource,
    methods: Mapping[str, Method],
    rotate: Rotate,
    seed: int,
    max_scans: int | None,
    progress: Progress = SILENT,
    helpers: Team = ALONE,
    odd: dict[str, str] | None = None,
) -> Results:
    """The protocol under one seed; what cannot be read is skipped in every row.

    Args:
        source: the tracks.
        methods: by the name of their row.
        rotate: how each scan is turned.
        seed: of these turns.
        max_scans: take this many scans of a longer track, evenly.
        progress: is told how many tracks are done.
        helpers: who does the work.
        odd: is told, by track, where true poses put scans elsewhere (`misplaced`).
    """
    limits = Limits(max_scans=max_scans)
    tracks = source if odd is None else _looked_at(source, odd)
    with progress.bar(f"evaluating, seed {seed}", len(source)) as bar:
        found = run_protocol(methods, tracks, rotate, seed, bar.at, limits=limits, helpers=helpers)
    unusable = tuple(_unusable(source))
    rows = tuple(replace(row, skipped=(*row.skipped, *unusable)) for row in found.methods)
    return replace(found, methods=rows)


def _looked_at(source: TrackSource, odd: dict[str, str]) -> Iterator[Track]:
    for track in source:
        if track.T_sensor_object is not None and (told := misplaced(track)):
            odd[track.name] = told
        yield track


def _unusable(source: TrackSource) -> Iterator[Skipped]:
    """Scans that were refused when the tracks were read; of a track refused as a whole one line."""
    for name in source.names:
        found = source.skipped_in(name)
        if name in source.refused and not found:
            found = (("all", source.refused[name]),)
        for scan, sentence in found:
            reason = sentence.partition(": ")[2] or sentence  # without the file
            yield Skipped(name, scan, reason.rstrip("."))


def write_evaluation(
    out: Path,
    source: TrackSource,
    runs: list[Results],
    drawn: tuple[str, Method],
    provenance: dict[str, Any],
) -> str:
    """Write metrics, scores, table and figures; returns the table.

    Args:
        out: folder.
        source: the tracks of the runs.
        runs: one a seed.
        drawn: row and method whose best, median and worst object are drawn.
        provenance: how the figures came about.
    """
    from wildshape.evaluation.pictures import write_figures

    write_scores(out, runs)
    write_table(out, runs, views=has_views(source))
    write_metrics(out, runs, provenance)
    write_figures(out, pooled(runs), gather(source, runs[0], *drawn))
    return markdown(runs)


def has_views(source: TrackSource) -> bool:
    """Whether the tracks are depth views."""
    first = next(iter(source), None)
    return first is not None and first.sensor.kind == "camera"
