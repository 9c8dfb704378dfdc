# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Making a table: every row trained and measured, the seed selected without labels beside it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from experiments.tables.data import as_values
from experiments.tables.measure import Measured, measure, seeds_of
from experiments.tables.show import Part, markdown, record
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Row, Table, Trained
from experiments.tables.train import Model, Workshop

from wildshape.errors import BadInputError
from wildshape.evaluation.results import Rotate
from wildshape.io.atomic import write_json, write_text
from wildshape.io.output import provenance
from wildshape.method.checkpoint import load_checkpoint
from wildshape.training.config import Recipe

# Writes a picture to a path, and says what is on it.
Figure = Callable[[Workshop, Sources, Path], dict[str, object]]


@dataclass(frozen=True)
class Making:
    """One table being made."""

    shop: Workshop
    sources: Sources
    table: Table

    def parts(self) -> list[Part]:
        """All blocks under all their protocols."""
        return [self._part(block, rotate) for block in self.table.blocks for rotate in block.rotate]

    def _part(self, block: Block, rotate: Rotate) -> Part:
        found = [(row, self._measured(row, block, rotate)) for row in block.rows]
        rows = tuple((row, measured) for row, measured in found if measured)
        chosen = {
            row.name: selected(row.name, measured)
            for row, measured in rows
            if _pooled(row, measured)
        }
        return Part(block, rotate, rows, chosen)

    def _measured(self, row: Row, block: Block, rotate: Rotate) -> tuple[Measured, ...]:
        seeds = seeds_of(row, rotate, self.table.seeds)
        most = self.sources.size.max_scans
        found = (measure(self.shop, row, block, rotate, seed, most) for seed in seeds)
        return tuple(one for one in found if one is not None)


def _pooled(row: Row, measured: tuple[Measured, ...]) -> bool:
    """Whether a seed can be selected: DPC, and what finds no pose, know no label-free cost."""
    ours = isinstance(row, Trained) and isinstance(row.recipe, Recipe) and row.answer != "canonical"
    return ours and len(measured) > 1


def selected(name: str, measured: tuple[Measured, ...]) -> Measured:
    """The seed whose label-free cost on held-out tracks is lowest; never the best by the truth."""
    best = min(measured, key=_cost)
    title = f"{name}, seed {best.results.seed}, selected without labels"
    methods = tuple(replace(scores, name=title) for scores in best.results.methods)
    return replace(best, results=replace(best.results, methods=methods))


def _cost(measured: Measured) -> float:
    assert measured.model is not None
    return cost_of(measured.model)


def cost_of(model: Model) -> float:
    """Median label-free cost on tracks held out of its training, metres."""
    return load_checkpoint(model.path)[1].cost_m[0]


def chosen_rows(table: Table, words: tuple[str, ...]) -> Table:
    """The table with those rows only whose names hold one of the words, or begin with a ^word.

    Raises:
        BadInputError: no row is left.
    """
    if not words:
        return table
    blocks = [
        replace(block, rows=tuple(r for r in block.rows if any(_called(r, w) for w in words)))
        for block in table.blocks
    ]
    kept = tuple(block for block in blocks if block.rows)
    if not kept:
        raise BadInputError(f"--rows {','.join(words)}: no row of this table is called so.")
    note = f"Only rows with {' or '.join(words)} were made."
    return replace(table, blocks=kept, notes=(*table.notes, note))


def refuse_unknown_rows(tables: Iterable[Table], words: tuple[str, ...]) -> None:
    """Words are looked for in all tables together: each may choose rows of another.

    Raises:
        BadInputError: a word is in no row's name.
    """
    rows = [row for table in tables for block in table.blocks for row in block.rows]
    for word in words:
        if not any(_called(row, word) for row in rows):
            raise BadInputError(f"--rows {word}: no row is called so.")


def _called(row: Row, word: str) -> bool:
    return row.name.startswith(word[1:]) if word.startswith("^") else word in row.name


def chosen_protocols(table: Table, names: tuple[str, ...]) -> Table:
    """The table under those input protocols only.

    Raises:
        BadInputError: no block is measured under one of them.
    """
    if not names:
        return table
    known = {one for block in table.blocks for one in block.rotate}
    if unknown := [name for name in names if name not in known]:
        raise BadInputError(f"--rotate {','.join(unknown)}: this table has no such protocol.")
    blocks = [
        replace(block, rotate=tuple(one for one in block.rotate if one in names))
        for block in table.blocks
    ]
    kept = tuple(block for block in blocks if block.rotate)
    note = f"Only under {' and '.join(names)}."
    return replace(table, blocks=kept, notes=(*table.notes, note))


def make(shop: Workshop, sources: Sources, table: Table, name: str, results: Path) -> str:
    """Make a table and write NAME.md and NAME.json; returns the markdown."""
    parts = Making(shop, sources, table).parts()
    table = replace(table, notes=(sources.size.said, *table.notes))
    made = provenance(shop.command)
    text = markdown(table, parts, shop.command, made)
    size = as_values(sources.size)
    write_json(results / f"{name}.json", {"size": size, **record(table, parts, made)})
    write_text(results / f"{name}.md", text)
    return text


def draw(shop: Workshop, sources: Sources, figure: Figure, name: str, results: Path) -> str:
    """Make a figure and write NAME.webp and NAME.json; returns where it is."""
    picture = results / f"{name}.webp"
    drawn = figure(shop, sources, picture)
    made = {"provenance": provenance(shop.command), "size": as_values(sources.size)}
    write_json(results / f"{name}.json", {**made, **drawn})
    return f"see {picture}"
