# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Another category at test time: trucks from 14 tracks, without labels (paper, supplement, 4)."""

from dataclasses import replace

from experiments.tables.rows import baselines, default_form, paper_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table, Trained

from wildshape.evaluation.paper import TRUCK_ROWS


def table(sources: Sources) -> Table:
    """A model of cars as it is, fine-tuned on the trucks it is measured on, and from nothing."""
    size, trucks = sources.size, sources.trucks()
    rows = []
    for cars in (
        paper_form(size, sources.drives("train")),
        default_form(size, sources.drives("train")),
    ):
        rows += [
            Trained(f"{cars.name}, cars only", cars.recipe, cars.data),
            Trained(f"{cars.name}, fine-tuned (train --start)", cars.recipe, trucks, start=cars),
            Trained(f"{cars.name}, these trucks only", cars.recipe, trucks),
        ]
    block = Block("Trucks", trucks, (*rows, *baselines("identity", "local-icp")), TRUCK_ROWS)
    fused = replace(block, title="Trucks, truth accumulated", accumulated=True)
    notes = (
        "Fine-tuned, as the paper has it, on the very tracks that are measured: no label is used.",
        "Truth accumulated: the scans of a track by their true poses, mirrored (CD) and as they are"
        " (CD partial), as the paper makes its truth.",
    )
    title = "Fine-tuning on trucks (paper, supplement)"
    return Table(title, (block, fused), size.side_seeds, notes)
