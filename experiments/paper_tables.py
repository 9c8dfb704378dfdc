# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's own claims, and what we add: tables at size `small`, three seeds.

python -m experiments.paper_tables --cad CAD --out RUN

One row after another, in the order of their worth; after each the pages are written again, with the
rows that are finished, and the time that is left is said. Stopped at any instant, the same command
goes on. `--plan` only says what is to be done.
"""

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from experiments.tables import ablations, added, vehicle, views
from experiments.tables.command import begin
from experiments.tables.make import Making, chosen_rows, make, refuse_unknown_rows
from experiments.tables.measure import measure, seeds_of
from experiments.tables.rows import ORACLE
from experiments.tables.show import as_printed
from experiments.tables.size import SIZES, changed
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Row, Table, Trained
from experiments.tables.train import Workshop

from wildshape.cli.terminal import say
from wildshape.errors import BadInputError
from wildshape.io.atomic import write_json, write_text
from wildshape.io.progress import duration

RECORD = "paper-tables.json"
"""Seconds that each finished row took."""
PRINTED = "printed.md"
"""The page with the paper's columns alone."""

# Seconds at size small, a first guess: of a step, for each scan in its batch, and of a measurement.
_STEP_S, _MEASURE_S = 0.004, 30.0
_LEAST_S = 1.0  # what took less was found, not made, and tells no pace


@dataclass(frozen=True)
class Settings:
    """What is made.

    Attributes:
        out: folder of data, runs, scores and pages.
        cad: folder of CAD meshes with a manifest; else our procedural shapes.
        device: of trainings and predictions.
        share: of steps and tracks, for a trial.
        steps: of each training instead of the size's own.
        seeds: trainings of each row.
        table: only this one.
        rows: only rows whose names hold one of these, with commas.
        plan: say what is to be done, and how long it takes, and do nothing.
    """

    out: Path
    cad: Path | None = None
    device: Literal["auto", "cpu", "cuda"] = "auto"
    share: float = 1.0
    steps: int | None = None
    seeds: int = 3
    table: Literal["vehicle", "views", "ablations", "added"] | None = None
    rows: str = ""
    plan: bool = False


@dataclass(frozen=True)
class Job:
    """A row of a table, trained once a seed, and measured in every block that has it.

    Attributes:
        table: its name.
        row: it.
        blocks: that have it.
        seeds: trainings.
        sources: size, and folder of meshes.
        known: a row before it is trained alike.
    """

    table: str
    row: Row
    blocks: tuple[Block, ...]
    seeds: int
    sources: Sources
    known: bool

    @property
    def name(self) -> str:
        """Of the row, of the first block that has it, and of all else that decides its figures."""
        seeds = f"{self.seeds} seeds" if self.seeds > 1 else "1 seed"
        made = f"{seeds}, size {self.sources.size.name}, CAD {self.sources.cad or 'none'}"
        return f"{self.table}, {self.blocks[0].title}: {self.row.name}, {made}"

    @property
    def guess_s(self) -> float:
        """Seconds, before anything was measured."""
        measured = sum(
            len(seeds_of(self.row, rotate, self.seeds))
            for block in self.blocks
            for rotate in block.rotate
        )
        return _MEASURE_S * measured + self._training_s

    @property
    def _training_s(self) -> float:
        if not isinstance(self.row, Trained) or self.known:
            return 0.0
        recipe = self.row.recipe
        scans = recipe.views.tracks * recipe.views.views
        return self.seeds * recipe.optim.steps * scans * _STEP_S

    def work(self, shop: Workshop) -> None:
        """Train and measure, as far as that is not done."""
        for block in self.blocks:
            for rotate in block.rotate:
                for seed in seeds_of(self.row, rotate, self.seeds):
                    measure(shop, self.row, block, rotate, seed, self.sources.size.max_scans)


def tables(
    sources: Sources, seeds: int, words: tuple[str, ...] = (), only: str | None = None
) -> dict[str, Table]:
    """The tables in the order of their worth; one oracle, the paper's.

    Args:
        sources: size and meshes.
        seeds: trainings of each row.
        words: only rows whose names hold one of these.
        only: this table alone.

    Raises:
        BadInputError: a word is in no row's name.
    """
    made = {
        "vehicle": _without(vehicle.table(sources), ORACLE),
        "views": _without(views.table(sources), ORACLE),
        "ablations": ablations.table(sources),
        "added": added.table(sources),
    }
    made = {name: made[name] for name in made if only in (None, name)}
    refuse_unknown_rows(made.values(), words)
    found = {name: _with_rows(table, words) for name, table in made.items()}
    return {name: replace(table, seeds=seeds) for name, table in found.items() if table}


def _without(table: Table, name: str) -> Table:
    """Without the rows of that name."""
    kept = [replace(b, rows=tuple(r for r in b.rows if r.name != name)) for b in table.blocks]
    return replace(table, blocks=tuple(kept))


def _with_rows(table: Table, words: tuple[str, ...]) -> Table | None:
    try:
        return chosen_rows(table, words)
    except BadInputError:
        return None


def jobs(made: dict[str, Table], sources: Sources) -> list[Job]:
    """A job a row; rows that are trained alike in two blocks are one."""
    found: dict[object, Job] = {}
    trained: set[str] = set()
    for name, table in made.items():
        for block in table.blocks:
            for row in block.rows:
                of = row.key if isinstance(row, Trained) else str(block.test)
                job = found.get((name, row.name, of)) or Job(
                    name, row, (), table.seeds, sources, of in trained
                )
                found[name, row.name, of] = replace(job, blocks=(*job.blocks, block))
                trained.add(of)
    return list(found.values())


def left_s(todo: list[Job], spent: dict[str, float], all_jobs: list[Job]) -> float:
    """Seconds left: what is guessed, by what the rows that were made took of their guesses."""
    done = [job for job in all_jobs if spent.get(job.name, 0.0) >= _LEAST_S]
    guessed = sum(job.guess_s for job in done)
    pace = sum(spent[job.name] for job in done) / guessed if guessed else 1.0
    return pace * sum(job.guess_s for job in todo)


def only_finished(table: Table, name: str, finished: list[Job]) -> Table | None:
    """The table with the rows that are finished."""
    have = [(job.row, block) for job in finished if job.table == name for block in job.blocks]
    kept = [replace(b, rows=tuple(row for row in b.rows if (row, b) in have)) for b in table.blocks]
    blocks = tuple(block for block in kept if block.rows)
    return replace(table, blocks=blocks) if blocks else None


def write_pages(
    shop: Workshop, sources: Sources, made: dict[str, Table], finished: list[Job]
) -> None:
    """Each table's page with the rows that are finished, and one with the paper's columns alone."""
    printed = []
    for name, whole in made.items():
        table = only_finished(whole, name, finished)
        if table is None:
            continue
        make(shop, sources, table, f"{name}-{sources.size.name}", shop.folder)
        parts = Making(shop, sources, table).parts()
        printed += [as_printed(part) for part in parts if part.rotate == "none"]
    head = f"# The paper's tables, our rows above its own\n\n`{shop.command}`\n"
    write_text(shop.folder / PRINTED, "\n".join([head, *printed]))


def run(settings: Settings, command: str) -> None:
    """Work through the plan.

    Raises:
        BadInputError: settings that leave nothing to do.
    """
    if settings.seeds < 1:
        raise BadInputError(f"--seeds {settings.seeds}: expected 1 or more.")
    size = changed(SIZES["small"], settings.share, settings.steps)
    sources = Sources(size, settings.cad and settings.cad.resolve())
    shop = Workshop(settings.out, settings.device, command)
    words = tuple(word.strip() for word in settings.rows.split(",") if word.strip())
    made = tables(sources, settings.seeds, words, settings.table)
    planned, spent = jobs(made, sources), _spent(settings.out / RECORD)
    for number, job in enumerate(planned, start=1):
        if settings.plan:
            state = "done" if job.name in spent else f"about {duration(job.guess_s)}"
            print(f"{number:3} {job.name}: {state}")
            continue
        if job.name in spent:
            continue
        began = time.monotonic()
        job.work(shop)
        spent[job.name] = round(time.monotonic() - began, 1)
        write_pages(shop, sources, made, [one for one in planned if one.name in spent])
        write_json(settings.out / RECORD, spent)  # after the pages: what it names is on them
        todo = [one for one in planned if one.name not in spent]
        left = duration(left_s(todo, spent, planned))
        say(
            f"{number} of {len(planned)} rows, {job.name}: {duration(spent[job.name])}; left {left}"
        )
    whole = not (settings.table or settings.rows)
    if not settings.plan and (whole or not (settings.out / PRINTED).is_file()):
        write_pages(shop, sources, made, [job for job in planned if job.name in spent])
    todo = [job for job in planned if job.name not in spent]
    print(f"{len(todo)} of {len(planned)} rows are left: {duration(left_s(todo, spent, planned))}")


def _spent(record: Path) -> dict[str, float]:
    return json.loads(record.read_text("utf-8")) if record.is_file() else {}


if __name__ == "__main__":
    begin(run, Settings, "experiments.paper_tables")
