# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A made table as markdown for people and as JSON with all that it came from."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from experiments.tables.data import as_values
from experiments.tables.measure import Measured
from experiments.tables.table import Block, Row, Table, Trained

from wildshape.evaluation.paper import PaperRow
from wildshape.evaluation.results import Summary, as_json, summarise
from wildshape.evaluation.tables import COLUMNS, ROTATE, notes, number, pipe_table, spread
from wildshape.evaluation.turning import Rotate

_PARTIAL = (
    ("CD partial", "cd_partial", 1, 3),
    ("precision partial", "precision_partial", 1, 3),
    ("coverage partial", "coverage_partial", 1, 3),
)
_LENGTHS = ("cd", "precision", "coverage", "cd_floor")
Column = tuple[str, str, int, int]
Columns = tuple[Column, ...]


@dataclass(frozen=True)
class Part:
    """A block under one input protocol.

    Attributes:
        block: it.
        rotate: the protocol.
        rows: with what was measured of them, a seed each.
        selected: name and measurement of the seeds that label-free costs select, by row.
    """

    block: Block
    rotate: Rotate
    rows: tuple[tuple[Row, tuple[Measured, ...]], ...]
    selected: dict[str, Measured]

    def summaries(self) -> list[Summary]:
        """One a row, means over seeds; the selected seed after its row."""
        found = []
        for row, measured in self.rows:
            found += summarise([one.results for one in measured])
            if row.name in self.selected:
                found += summarise([self.selected[row.name].results])
        return found


def markdown(table: Table, parts: Sequence[Part], command: str, made: dict[str, Any]) -> str:
    """The whole page."""
    where = f"{made['hardware']['cpu']}, {made['hardware']['gpu'] or 'no GPU'}"
    head = [
        f"# {table.title}",
        f"`{command}`, commit {made['code'][:12]}, {made['time_utc']}, {where}.",
        "Mean ± standard deviation over training seeds (over turns for rows that are not trained)."
        " † printed by the paper, on other data: a ratio may be looked at, no common benchmark.",
    ]
    foot = "\n".join(f"- {note}" for note in table.notes)
    return "\n\n".join([*head, *(_part(part) for part in parts), *([foot] if foot else [])]) + "\n"


def _part(part: Part) -> str:
    summaries = part.summaries()
    columns = _columns(part.block, summaries)
    rows = [_ours(summary, columns) for summary in summaries]
    if part.rotate == "none":
        rows += [_paper(row, columns, part.block) for row in part.block.paper]
    heading = ["method", "seeds", *(column[0] for column in columns), "scans: shape / pose"]
    title = f"## {part.block.title}: {ROTATE[part.rotate]}"
    return "\n\n".join([title, pipe_table(heading, rows), notes(summaries)])


def _columns(block: Block, summaries: Sequence[Summary]) -> Columns:
    partial = any(summary.mean["cd_partial"] is not None for summary in summaries)
    columns = (*COLUMNS[:3], *(_PARTIAL if partial else ()), *COLUMNS[3:])
    if not block.percent:
        return columns
    return tuple(_of_unit_size(column) for column in columns)


def _of_unit_size(column: Column) -> Column:
    """Lengths have no unit there, and those of shapes are times 100."""
    heading, name, factor, digits = column
    heading = heading.removesuffix(", m")
    return (
        (f"{heading} x 100", name, 100, 2) if name in _LENGTHS else (heading, name, factor, digits)
    )


def _ours(summary: Summary, columns: Columns) -> list[str]:
    cells = [
        number(summary.mean[name], factor, digits) + spread(summary.std[name], factor, digits)
        for _, name, factor, digits in columns
    ]
    counted = f"{summary.completions} / {summary.registrations}"
    return [summary.name, str(len(summary.per_seed)), *cells, counted]


def _paper(row: PaperRow, columns: Columns, block: Block) -> list[str]:
    """The paper prints CD of views times 100 already, as our columns do."""
    cells = []
    for _, name, factor, digits in columns:
        printed = _printed(name, block)
        scale = 1 if name in _LENGTHS else factor
        value = getattr(row, printed, None)
        cells.append(number(value, scale, digits) + spread(row.std.get(printed), scale, digits))
    return [f"† {row.data}: {row.method}", "", *cells, ""]


def _printed(name: str, block: Block) -> str:
    """Which of the paper's figures belongs into a column; the empty name is none."""
    if not block.paper_partial:
        return name
    return "" if name in _LENGTHS else name.removesuffix("_partial")


def record(table: Table, parts: Sequence[Part], made: dict[str, Any]) -> dict[str, Any]:
    """The same as JSON: figures, seeds, recipes, data, trainings, commits, hardware."""
    return {
        "title": table.title,
        "provenance": made,
        "notes": list(table.notes),
        "rows": {row.name: _row(row, measured) for p in parts for row, measured in p.rows},
        "parts": [_part_json(part) for part in parts],
    }


def _row(row: Row, measured: Sequence[Measured]) -> dict[str, Any]:
    """How a row came about."""
    if not isinstance(row, Trained):
        return {"kind": type(row).__name__}
    return {
        "kind": "trained",
        "recipe": as_values(row.recipe),
        "data": as_values(row.data),
        "teacher": row.teacher.name if isinstance(row.teacher, Trained) else row.teacher,
        "start": row.start.name if row.start else None,
        "trained": [one.model.made for one in measured if one.model],
    }


def _part_json(part: Part) -> dict[str, Any]:
    runs = [one.results for _, measured in part.rows for one in measured]
    runs += [one.results for one in part.selected.values()]
    found = as_json(runs, {})
    seeds = sorted({run.seed for run in runs})
    made = {row.name: [one.made for one in measured] for row, measured in part.rows}
    return {
        **found,
        "block": part.block.title,
        "data": as_values(part.block.test),
        "seeds": seeds,
        "provenance": made,
        "paper": [asdict(row) for row in part.block.paper],
    }
