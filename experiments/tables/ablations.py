# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What each part of the paper's method is good for (supplement, tables 5 and 6)."""

from dataclasses import replace
from typing import Any, Literal

from experiments.tables.rows import flat, paper_form, views_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table, Trained

from wildshape.evaluation.paper import ABLATION_ROWS, VIEW_COUNT_ROWS
from wildshape.evaluation.results import Rotate
from wildshape.simulate.config import Category

Part = Literal["network", "loss", "views"]
_TURNS: tuple[Rotate, ...] = ("none", "yaw")


def table(sources: Sources) -> Table:
    """On drives, and on depth views: of cars alone before size small."""
    blocks = [_paper_drives(sources)]
    categories: tuple[Category, ...] = ("car",)
    if sources.size.steps is None or sources.size.like == "small":
        categories = ("airplane", "car", "chair")
    blocks += [_views(sources, category) for category in categories]
    title = "Ablations (paper, supplement, tables 5 and 6)"
    return Table(title, tuple(blocks), sources.size.ablation_seeds)


def changed(row: Trained, name: str, part: Part, **values: Any) -> Trained:
    """The row with another value in one part of its recipe."""
    recipe = row.recipe
    new = replace(getattr(recipe, part), **values)
    return replace(row, name=name, recipe=replace(recipe, **{part: new}))


def _paper_drives(sources: Sources) -> Block:
    base = paper_form(sources.size, sources.drives("train"))
    rows = (
        replace(base, name="full: beta 0.05, K 4, 4 views"),
        changed(base, "w/o projection", "loss", beta=0.0),
        changed(base, "w/o hindsight: K 1", "network", branches=1),
        changed(base, "hindsight for a track", "loss", hindsight="track"),
        changed(base, "hindsight for a batch", "loss", hindsight="batch"),
        changed(base, "beta 0.25", "loss", beta=0.25),
        changed(base, "K 2", "network", branches=2),
        changed(base, "K 8", "network", branches=8),
        changed(base, "2 views", "views", views=2),
        changed(base, "8 views", "views", views=8),
    )
    title = "Simulated drives, the paper's form"
    return Block(title, sources.drives("test"), rows, VIEW_COUNT_ROWS, _TURNS)


def _views(sources: Sources, category: Category) -> Block:
    base = views_form(sources.size, sources.views(category, "train"))
    rows = (
        replace(base, name=f"{category}, full"),
        changed(base, f"{category}, w/o projection", "loss", beta=0.0),
        changed(base, f"{category}, w/o hindsight: K 1", "network", branches=1),
        *((flat(base, "car, losses on 2D projections"),) if category == "car" else ()),
    )
    paper = tuple(row for row in ABLATION_ROWS if f" {category}," in row.data)
    title = f"Depth views, {category}, the paper's form"
    return Block(title, sources.views(category, "test"), rows, paper, percent=True)
