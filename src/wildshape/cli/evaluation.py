# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `evaluate` and `demo` share: the methods, the protocol with progress, the files."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wildshape.cli.input.tracks import Reading
    from wildshape.evaluation.method import Method
    from wildshape.evaluation.results import Results


def choose_baselines(names: "Sequence[str]") -> "dict[str, Method]":
    """The baselines named; `none` is none.

    Raises:
        BadInputError: one that there is not.
        MissingExtraError: one that needs a library that is not installed.
    """
    from wildshape.baselines.named import baseline

    return {name: baseline(name) for name in names if name != "none"}


def evaluate_once(
    reading: "Reading",
    methods: "dict[str, Method]",
    rotate: Literal["none", "yaw", "so3"],
    seed: int,
    max_scans: int | None,
) -> "Results":
    """The protocol under one seed, with progress."""
    from wildshape.cli.terminal import progress
    from wildshape.evaluation.protocol import run as run_protocol
    from wildshape.evaluation.results import Limits

    with progress(f"evaluating, seed {seed}", len(reading.source)) as bar:
        tracks = (track for _, track in reading.tracks())
        return run_protocol(
            methods, tracks, rotate, seed, bar.at, limits=Limits(max_scans=max_scans)
        )


def write(
    out: Path,
    reading: "Reading",
    runs: "list[Results]",
    drawn: "tuple[str, Method]",
    made: dict[str, Any],
) -> str:
    """Write metrics, scores, table and figures; returns the table.

    Args:
        out: folder.
        reading: the tracks of the runs.
        runs: one a seed.
        drawn: row and method whose best, median and worst object are drawn.
        made: how the figures came about.
    """
    from wildshape.evaluation.examples import gather
    from wildshape.evaluation.pictures import write_figures
    from wildshape.evaluation.summary import write_metrics, write_scores
    from wildshape.evaluation.tables import markdown, write_table

    tracks = (track for _, track in reading.tracks())
    write_figures(out, runs[0], gather(tracks, runs[0], *drawn))
    write_scores(out, runs)
    write_table(out, runs, views=has_views(reading))
    write_metrics(out, runs, made)
    return markdown(runs)


def has_views(reading: "Reading") -> bool:
    """Whether the tracks are depth views."""
    first = next((track for _, track in reading.tracks()), None)
    return first is not None and first.sensor.kind == "camera"
