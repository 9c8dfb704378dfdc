# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The markdown that people read: our rows, what was left out, and the paper's rows apart."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wildshape.evaluation.paper import LIDAR_ROWS, VIEW_ROWS, PaperRow
from wildshape.evaluation.results import Results
from wildshape.evaluation.summary import FIGURES, Figure, Summary, summarise
from wildshape.io.atomic import write_text

COUNTED = "scans: shape / pose"
ROTATE: dict[str, str] = {
    "none": "scans as recorded",
    "yaw": "each scan turned by its own random yaw",
    "so3": "each scan turned by its own random rotation",
}


def markdown(runs: Sequence[Results]) -> str:
    """The table of runs that differ in their seed only, mean and standard deviation over seeds."""
    summaries = summarise(runs)
    columns = columns_of(summaries)
    rows = [[summary.name, *cells_of(summary, columns)] for summary in summaries]
    heading = ["method", *(column.heading for column in columns), COUNTED]
    seeds = f"{len(runs)} seed{'s' if len(runs) > 1 else ''}"
    parts = [
        f"### {ROTATE[runs[0].rotate].capitalize()} ({seeds})",
        pipe_table(heading, rows),
        notes(summaries),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def paper_markdown(rows: Sequence[PaperRow] = LIDAR_ROWS) -> str:
    """The rows that the paper prints, under a heading that says that the data differ."""
    known = {name for row in rows for name, printed in vars(row).items() if printed is not None}
    columns = [headed(figure) for figure in FIGURES if figure.name in known]
    heading = ["data", "method", *(column.heading for column in columns)]
    cells = [
        [
            row.data,
            row.method,
            *(cell(getattr(row, f.name), row.std.get(f.name), f) for f in columns),
        ]
        for row in rows
    ]
    title = "### The paper's printed figures: other data, so no common benchmark"
    return f"{title}\n\n{pipe_table(heading, cells)}\n"


def write_table(folder: Path, runs: Sequence[Results], *, views: bool = False) -> Path:
    """Write `table.md`: ours, then the paper's LiDAR rows (or those of its depth views)."""
    path = folder / "table.md"
    paper = paper_markdown(VIEW_ROWS if views else LIDAR_ROWS)
    write_text(path, f"{markdown(runs)}\n{paper}")
    return path


def headed(figure: Figure) -> Figure:
    """A figure that is a column only beside the paper's has its name for a heading."""
    return replace(figure, heading=figure.heading or figure.name.replace("_", " "))


def columns_of(summaries: Sequence[Summary]) -> list[Figure]:
    """The figures that are columns of a table: those that one of its rows has."""
    known = {
        name for summary in summaries for name, mean in summary.mean.items() if mean is not None
    }
    return [figure for figure in FIGURES if figure.heading and figure.name in known]


def cells_of(summary: Summary, columns: Sequence[Figure]) -> list[str]:
    """A row: the figures, then how many scans they are of."""
    figures = [cell(summary.mean[f.name], summary.std[f.name], f) for f in columns]
    return [*figures, f"{summary.completions} / {summary.registrations}"]


def cell(mean: float | None, std: float | None, figure: Figure) -> str:
    """A mean and its standard deviation, if there is one; a dash where there is no figure."""
    if mean is None:
        return "–"  # noqa: RUF001
    text = f"{figure.factor * mean:.{figure.digits}f}"
    if std is None or figure.digits == 0:
        return text
    return f"{text} ± {figure.factor * std:.{figure.digits}f}"


def notes(summaries: Sequence[Summary]) -> str:
    """The foot of a table: truth, engines, and what was left out."""
    truths = sorted({summary.truth for summary in summaries if summary.truth})
    points = {summary.mean["truth_points"] for summary in summaries} - {None}
    counts = ", ".join(f"{count:.0f}" for count in sorted(p for p in points if p is not None))
    partial, lines = _partial(summaries), []
    if truths:
        lines.append(f"Truth: {', '.join(truths)}, {counts} points (median){partial}.")
        lines.append("CD floor: 0.5 sqrt(area / count), both sides; compare CD at like counts.")
    if any("mirrored" in truth for truth in truths):
        lines.append("Mirrored truth is made of the scans; clouds of them can be under the floor.")
    if partial and any("shape" in truth for truth in truths):
        lines.append("CD partial is of the scans with mirrored truth alone, CD of all.")
    lines += [f"{summary.name}: {summary.about}." for summary in summaries if summary.about]
    lines += [
        f"Left out, {summary.name}: {count} x {reason}."
        for summary in summaries
        for reason, count in summary.skipped.items()
    ]
    return "\n".join(f"- {line}" for line in lines)


def _partial(summaries: Sequence[Summary]) -> str:
    counts = [summary.mean["partial_points"] for summary in summaries]
    known = [count for count in counts if count is not None]
    return f"; partial, {max(known):.0f} points" if known else ""


def pipe_table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A markdown table; the first column is text."""
    rule = ["---", *("---:" for _ in heading[1:])]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in (heading, rule, *rows))
