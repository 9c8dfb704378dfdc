# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's 3D vehicle data set as simulated drives: its tables 2a, 3a and 4 (last block)."""

from dataclasses import replace

from experiments.tables.rows import (
    REGISTERING,
    baselines,
    default_form,
    dpc_drives,
    oracle,
    paper_form,
    paper_oracle,
)
from experiments.tables.sources import Sources
from experiments.tables.table import PROTOCOLS, Block, Table

from wildshape.evaluation.paper import LIDAR_ROWS, VEHICLE


def table(sources: Sources) -> Table:
    """Ours, the oracle and what registers, under three input protocols."""
    size, data = sources.size, sources.drives("train")
    rows = (
        paper_form(size, data),
        default_form(size, data),
        oracle(size, data),
        paper_oracle(oracle(size, data)),
        dpc_drives(size, data),
        *baselines("one-scan", *REGISTERING),
    )
    paper = tuple(row for row in LIDAR_ROWS if row.data == VEHICLE)
    title = "Simulated drives past cars"
    block = Block(title, sources.drives("test"), rows, paper, PROTOCOLS)
    fused = replace(block, title=f"{title}, truth accumulated", rotate=("none",), accumulated=True)
    note = (
        "Truth accumulated: the scans of a track by their true poses, mirrored (CD) and as they are"
        " (CD partial), as the paper makes its truth."
    )
    title = "Vehicles: completion and registration (paper, tables 2 to 4)"
    return Table(title, (block, fused), size.seeds, (note,))
