# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The markdown that people read: our rows, what was left out, and the paper's rows apart."""

from collections.abc import Sequence
from pathlib import Path

from wildshape.evaluation.paper import LIDAR_ROWS, VIEW_ROWS, PaperRow
from wildshape.evaluation.results import Results, Summary, summarise
from wildshape.evaluation.turning import Rotate
from wildshape.io.atomic import write_text

ROTATE: dict[Rotate, str] = {
    "none": "scans as recorded",
    "yaw": "each scan turned by its own random yaw",
    "so3": "each scan turned by its own random rotation",
}
# heading, name of the figure, factor, decimals
COLUMNS = (
    ("CD, m", "cd", 1, 3),
    ("precision", "precision", 1, 3),
    ("coverage", "coverage", 1, 3),
    ("points", "points", 1, 0),
    ("CD floor", "cd_floor", 1, 3),
    ("acc 30, %", "acc30", 100, 1),
    ("rot, deg", "rot_median_deg", 1, 2),
    ("trans, m", "trans_median_m", 1, 3),
    ("acc 30 sym, %", "acc30_sym", 100, 1),
    ("rot sym, deg", "rot_sym_median_deg", 1, 2),
)
_BOXES = (
    ("box IoU", "box_iou", 1, 3),
    ("heading 30, %", "heading30", 100, 1),
    ("heading 30 sym, %", "heading30_sym", 100, 1),
)
_PARTIAL = ("CD partial", "cd_partial", 1, 3)
_PAPER = tuple(column for column in COLUMNS if column[1] in PaperRow.__dataclass_fields__)


def markdown(runs: Sequence[Results]) -> str:
    """The table of runs that differ in their seed only, mean and standard deviation over seeds."""
    summaries = summarise(runs)
    columns = _columns(summaries)
    rows = [[summary.name, *_cells(summary, columns), _counted(summary)] for summary in summaries]
    heading = ["method", *(column[0] for column in columns), "scans: shape / pose"]
    seeds = f"{len(runs)} seed{'s' if len(runs) > 1 else ''}"
    parts = [
        f"### {ROTATE[runs[0].rotate].capitalize()} ({seeds})",
        pipe_table(heading, rows),
        notes(summaries),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def paper_markdown(rows: Sequence[PaperRow] = LIDAR_ROWS) -> str:
    """The rows that the paper prints, under a heading that says that the data differ."""
    heading = ["data", "method", *(column[0] for column in _PAPER)]
    cells = [
        [r.data, r.method, *(number(getattr(r, name), f, d) for _, name, f, d in _PAPER)]
        for r in rows
    ]
    title = "### The paper's printed figures: other data, so no common benchmark"
    return f"{title}\n\n{pipe_table(heading, cells)}\n"


def write_table(folder: Path, runs: Sequence[Results], *, views: bool = False) -> Path:
    """Write `table.md`: ours, then the paper's LiDAR rows (or those of its depth views)."""
    path = folder / "table.md"
    paper = paper_markdown(VIEW_ROWS if views else LIDAR_ROWS)
    write_text(path, f"{markdown(runs)}\n{paper}")
    return path


def _columns(summaries: Sequence[Summary]) -> list[tuple[str, str, int, int]]:
    partial = any(summary.mean["cd_partial"] is not None for summary in summaries)
    boxes = any(summary.mean["box_iou"] is not None for summary in summaries)
    extra = ([_PARTIAL] if partial else [], _BOXES if boxes else ())
    return [*COLUMNS[:3], *extra[0], *COLUMNS[3:], *extra[1]]


def _cells(summary: Summary, columns: Sequence[tuple[str, str, int, int]]) -> list[str]:
    return [
        number(summary.mean[name], factor, digits) + spread(summary.std[name], factor, digits)
        for _, name, factor, digits in columns
    ]


def number(value: float | None, factor: int, digits: int) -> str:
    """A cell; a dash where there is no figure."""
    return "–" if value is None else f"{factor * value:.{digits}f}"  # noqa: RUF001


def spread(value: float | None, factor: int, digits: int) -> str:
    """What follows a mean: the deviation, or nothing."""
    return "" if value is None or digits == 0 else f" ± {factor * value:.{digits}f}"


def _counted(summary: Summary) -> str:
    return f"{summary.completions} / {summary.registrations}"


def notes(summaries: Sequence[Summary]) -> str:
    """The foot of a table: truth, engines, and what was left out."""
    truths = sorted({summary.truth for summary in summaries if summary.truth})
    points = {summary.mean["truth_points"] for summary in summaries} - {None}
    counts = ", ".join(f"{count:.0f}" for count in sorted(p for p in points if p is not None))
    lines = []
    if truths:
        lines.append(f"Truth: {', '.join(truths)}, {counts} points (median){_partial(summaries)}.")
        lines.append("CD floor: 0.5 sqrt(area / count), both sides; compare CD at like counts.")
    if "mirrored" in truths:
        lines.append("Mirrored truth is made of the scans; clouds of them can be under the floor.")
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
