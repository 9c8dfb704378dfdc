# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every table and figure of the paper as one command.

python -m experiments.tables vehicle --size tiny --cad CAD
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro
from experiments.tables import (
    ablations,
    added,
    codes,
    encoders,
    kitti,
    ladder,
    objects,
    trucks,
    vehicle,
    views,
)
from experiments.tables.command import begin
from experiments.tables.make import (
    chosen_protocols,
    chosen_rows,
    draw,
    make,
    refuse_unknown_rows,
)
from experiments.tables.size import SIZES, changed
from experiments.tables.sources import Sources
from experiments.tables.train import Workshop

from wildshape.errors import BadInputError

TABLES = {
    "views": views.table,
    "vehicle": vehicle.table,
    "kitti": kitti.table,
    "ablations": ablations.table,
    "added": added.table,
    "trucks": trucks.table,
    "encoders": encoders.table,
    "ladder": ladder.table,
}
FIGURES = {
    "codes": codes.draw,
    "objects": objects.drives,
    "objects-kitti": objects.kitti,
    "objects-trucks": objects.trucks,
    "objects-airplane": objects.views_of("airplane"),
    "objects-car": objects.views_of("car"),
    "objects-chair": objects.views_of("chair"),
    "rungs": ladder.draw,
}
Name = Literal[
    "views",
    "vehicle",
    "kitti",
    "ablations",
    "added",
    "trucks",
    "encoders",
    "ladder",
    "codes",
    "objects",
    "objects-kitti",
    "objects-trucks",
    "objects-airplane",
    "objects-car",
    "objects-chair",
    "rungs",
]


@dataclass(frozen=True)
class Settings:
    """Make a table or a figure of the paper: train, measure, print ours beside the paper's rows.

    What is finished is found again below `out`, also by other tables; stopped at any instant, the
    same command goes on.

    Attributes:
        table: which; codes and those of objects are figures.
        size: test (seconds), tiny (minutes on a CPU), hour, small (hours) or full (a GPU).
        out: folder of data, runs and scores.
        results: folder of the page and its JSON; by default `out`.
        cad: folder of CAD meshes with a manifest; else our procedural shapes.
        kitti: KITTI raw, the folder above the dates.
        device: of trainings and predictions.
        rows: only rows whose names hold one of these, with commas; ^word: begin with it.
        rotate: only these input protocols (none, yaw, so3), with commas.
        seeds: trainings of each row, and turns of each baseline; 0: as the size has it.
        steps: of each training instead of the size's own.
    """

    table: Annotated[Name, tyro.conf.Positional]
    size: Literal["test", "tiny", "hour", "small", "full"] = "tiny"
    out: Path = Path("runs/tables")
    results: Path | None = None
    cad: Path | None = None
    kitti: Path | None = None
    device: Literal["auto", "cpu", "cuda"] = "auto"
    rows: str = ""
    rotate: str = ""
    seeds: int = 0
    steps: int | None = None


def main(settings: Settings, command: str) -> None:
    """Make it and print the page."""
    if settings.seeds < 0:
        raise BadInputError(f"--seeds {settings.seeds}: expected 0 or more.")
    size = changed(SIZES[settings.size], steps=settings.steps)
    size = replace(size, seeds=settings.seeds) if settings.seeds > 0 else size
    cad, kitti = (path and path.resolve() for path in (settings.cad, settings.kitti))
    sources = Sources(size, cad, kitti)  # its data are found again from any folder
    shop = Workshop(settings.out, settings.device, command)
    name, results = f"{settings.table}-{size.name}", settings.results or settings.out
    words = _words(settings.rows)
    if settings.table in FIGURES:
        if words or settings.rotate:
            raise BadInputError(f"{settings.table} is a figure: leave out --rows and --rotate.")
        print(draw(shop, sources, FIGURES[settings.table], name, results))
        return
    whole = TABLES[settings.table](sources)
    refuse_unknown_rows([whole], words)
    table = chosen_rows(whole, words)
    table = chosen_protocols(table, _words(settings.rotate))
    table = replace(table, seeds=settings.seeds) if settings.seeds > 0 else table
    print(make(shop, sources, table, name, results))


def _words(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split(",") if word.strip())


if __name__ == "__main__":
    begin(main, Settings, "experiments.tables")
