# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Depth views of airplanes, cars and chairs (paper, tables 1 and 4; supplement, table 3)."""

from experiments.tables.given import Given
from experiments.tables.rows import (
    baselines,
    dpc_views,
    views_form,
    views_oracle,
)
from experiments.tables.table import Block, Table

from wildshape.evaluation.paper import VIEW_ROWS, VIEW_SEED_ROWS
from wildshape.simulate.config import Category


def table(given: Given) -> Table:
    """A block a category: ours, the oracle, DPC in both forms, identity and ICP."""
    blocks = tuple(_block(given, category) for category in ("airplane", "car", "chair"))
    title = "Depth views: completion and registration (paper, tables 1, 4 and 7)"
    note = "Objects have a box diagonal of 1; trans is in this unit. 5 views each, no turns."
    return Table(title, blocks, given.size.side_seeds, (note,))


def _block(given: Given, category: Category) -> Block:
    data = given.views(category, "train")
    rows = (
        views_form(given.size, data),
        views_oracle(given.size, data),
        *dpc_views(given.size, data),
        *baselines("one-scan", "identity", "multi-start-icp"),
    )
    paper = tuple(r for r in (*VIEW_ROWS, *VIEW_SEED_ROWS) if f" {category}," in r.data)
    test = given.views(category, "test")
    return Block(category.capitalize(), test, rows, paper, percent=True)
