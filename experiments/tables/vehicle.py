# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The paper's 3D vehicle data set as simulated drives: its tables 2a, 3a and 4 (last block)."""

from experiments.tables.given import Given
from experiments.tables.rows import (
    REGISTERING,
    baselines,
    default_form,
    dpc_drives,
    oracle,
    paper_form,
)
from experiments.tables.table import PROTOCOLS, Block, Table

from wildshape.evaluation.paper import LIDAR_ROWS, VEHICLE


def table(given: Given) -> Table:
    """Ours, the oracle and what registers, under three input protocols."""
    size, data = given.size, given.drives("train")
    rows = (
        paper_form(size, data),
        default_form(size, data),
        oracle(size, data),
        dpc_drives(size, data),
        *baselines("one-scan", *REGISTERING),
    )
    paper = tuple(row for row in LIDAR_ROWS if row.data == VEHICLE)
    block = Block("Simulated drives past cars", given.drives("test"), rows, paper, PROTOCOLS)
    return Table(
        "Vehicles: completion and registration (paper, tables 2 to 4)", (block,), size.seeds
    )
