# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A made table as markdown for people and as JSON with all that it came from."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from experiments.tables.command import commit
from experiments.tables.data import as_values
from experiments.tables.measure import Measured
from experiments.tables.table import Block, Row, Table, Trained

from wildshape.evaluation.paper import PaperRow
from wildshape.evaluation.results import Rotate
from wildshape.evaluation.summary import FIGURES, Figure, Summary, as_json, summarise
from wildshape.evaluation.tables import (
    COUNTED,
    ROTATE,
    cell,
    cells_of,
    columns_of,
    headed,
    notes,
    pipe_table,
)

_PARTIAL = ("precision_partial", "coverage_partial")
_LENGTHS = ("cd", "precision", "coverage", "cd_floor")


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
        f"`{command}`, commit {_commits(parts)}, {made['time_utc']}, {where}.",
        "Mean ± standard deviation over training seeds (over turns for rows that are not trained)."
        " † printed by the paper, on other data: a ratio may be looked at, no common benchmark.",
    ]
    foot = "\n".join(f"- {note}" for note in table.notes)
    return "\n\n".join([*head, *(_part(part) for part in parts), *([foot] if foot else [])]) + "\n"


def _commits(parts: Sequence[Part]) -> str:
    """All that trained or measured a row: what is finished is found again by later ones."""
    rows = [one for part in parts for _, measured in part.rows for one in measured]
    codes = {one.made["code"] for one in rows}
    codes |= {one.model.made["provenance"]["code"] for one in rows if one.model}
    return ", ".join(sorted(map(commit, codes)))


def _part(part: Part) -> str:
    summaries = part.summaries()
    columns = _columns(part.block, summaries)
    rows = [_ours(summary, columns) for summary in summaries]
    if part.rotate == "none":
        rows += [_paper(row, columns) for row in part.block.paper]
    heading = ["method", "seeds", *(column.heading for column in columns), COUNTED]
    title = f"## {part.block.title}: {ROTATE[part.rotate]}"
    return "\n\n".join([title, pipe_table(heading, rows), notes(summaries)])


def as_printed(part: Part) -> str:
    """The part with the paper's columns alone, its rows beneath ours."""
    summaries = part.summaries()
    known = {*PaperRow.__dataclass_fields__} - {*_PARTIAL}
    columns = [one for one in _columns(part.block, summaries) if one.name in known]
    rows = [[summary.name, *cells_of(summary, columns)[:-1]] for summary in summaries]
    for row in part.block.paper:
        name, _, *cells, _ = _paper(row, columns)
        rows.append([name, *cells])
    heading = ["method", *(column.heading for column in columns)]
    return f"## {part.block.title}: {ROTATE[part.rotate]}\n\n{pipe_table(heading, rows)}\n"


def _columns(block: Block, summaries: Sequence[Summary]) -> list[Figure]:
    """Those of an evaluation's own table, and both parts of the CD against partial truth."""
    columns = columns_of(summaries)
    names = {figure.name for figure in columns}
    if "cd_partial" in names:
        names |= {*_PARTIAL}
        columns = [headed(figure) for figure in FIGURES if figure.name in names]
    return [_of_unit_size(figure) for figure in columns] if block.percent else columns


def _of_unit_size(figure: Figure) -> Figure:
    """Lengths have no unit there, and those of shapes are times 100."""
    heading = figure.heading.removesuffix(", m")
    if figure.name not in _LENGTHS:
        return replace(figure, heading=heading)
    return replace(figure, heading=f"{heading} x 100", factor=100, digits=2)


def _ours(summary: Summary, columns: Sequence[Figure]) -> list[str]:
    return [summary.name, str(len(summary.per_seed)), *cells_of(summary, columns)]


def _paper(row: PaperRow, columns: Sequence[Figure]) -> list[str]:
    """The paper prints CD of views times 100 already, as our columns do."""
    cells = []
    for figure in columns:
        scale = replace(figure, factor=1) if figure.name in _LENGTHS else figure
        cells.append(cell(getattr(row, figure.name, None), row.std.get(figure.name), scale))
    return [f"† {row.data}: {row.method}", "", *cells, ""]


def record(table: Table, parts: Sequence[Part], made: dict[str, Any]) -> dict[str, Any]:
    """The same as JSON: figures, seeds, recipes, data, trainings, commits, hardware."""
    return {
        "title": table.title,
        "provenance": made,
        "notes": list(table.notes),
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
        "rows": {row.name: _row(row, measured) for row, measured in part.rows},
        "seeds": seeds,
        "provenance": made,
        "paper": [asdict(row) for row in part.block.paper],
    }
