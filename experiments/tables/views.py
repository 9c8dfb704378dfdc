# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Depth views of airplanes, cars and chairs (paper, tables 1 and 4; supplement, 7 and 8)."""

from dataclasses import replace

from experiments.tables.rows import (
    aligned,
    baselines,
    dpc_views,
    flat,
    paper_oracle,
    views_form,
    views_oracle,
)
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table

from wildshape.evaluation.paper import VIEW_ROWS, VIEW_SEED_ROWS
from wildshape.simulate.config import Category

NOISE = 0.01
"""Sigma of noisy depths, in diagonals of the object: 5 cm on a car of 5 m."""


def table(sources: Sources) -> Table:
    """Two blocks a category: ours, the oracle, DPC in both forms, ICP; and views with noise."""
    categories: tuple[Category, ...] = ("airplane", "chair", "car")  # cars: a coin's toss
    blocks = [_block(sources, category) for category in categories]
    blocks += [_noisy(sources, category) for category in categories]
    title = "Depth views: completion and registration (paper, tables 1, 4 and 7)"
    note = "Objects have a box diagonal of 1; trans is in this unit. 5 views each, no turns."
    return Table(title, tuple(blocks), sources.size.side_seeds, (note,))


def _block(sources: Sources, category: Category) -> Block:
    data = sources.views(category, "train")
    ours, taught = views_form(sources.size, data), views_oracle(sources.size, data)
    rivals = dpc_views(sources.size, data)
    rows = (
        ours,
        *((flat(ours, "ours, losses on 2D projections"),) if category == "car" else ()),
        taught,
        paper_oracle(taught),
        *rivals,
        *(aligned(rival) for rival in rivals),
        *baselines("one-scan", "identity", "multi-start-icp"),
    )
    paper = tuple(r for r in (*VIEW_ROWS, *VIEW_SEED_ROWS) if f" {category}," in r.data)
    test = sources.views(category, "test")
    return Block(category.capitalize(), test, rows, paper, percent=True)


def _noisy(sources: Sources, category: Category) -> Block:
    """The same views with noise, by weights that know it and by weights that do not."""
    known = views_form(sources.size, sources.views(category, "train", NOISE))
    clean = views_form(sources.size, sources.views(category, "train"))
    rows = (
        replace(known, name="ours, paper's form, trained with noise"),
        replace(clean, name="ours, paper's form, trained without"),
        *baselines("one-scan", "multi-start-icp"),
    )
    title = f"{category.capitalize()}, depths with noise of {NOISE:g}"
    return Block(title, sources.views(category, "test", NOISE), rows, percent=True)
