# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rows that several tables share."""

from dataclasses import replace

from experiments.tables.data import Data
from experiments.tables.size import Size, sized, sized_dpc
from experiments.tables.table import Baseline, Trained

from wildshape.baselines.dpc.objective import dpc, dpc_dagger, dpc_lidar
from wildshape.training.config import Recipe
from wildshape.training.recipes import default, paper_lidar, paper_views, shape_oracle, small

ORACLE = "oracle"
"""Taught the true pose, too; the paper's own is `paper_oracle`."""
REGISTERING = (
    "identity",
    "local-icp",
    "global-icp",
    "multi-start-icp",
    "gicp",
    "kiss-matcher",
)


def baselines(*names: str) -> tuple[Baseline, ...]:
    """Rows by the names of `wildshape evaluate --baselines`."""
    return tuple(Baseline(name) for name in names)


def paper_form(size: Size, data: Data) -> Trained:
    """The paper's method on LiDAR."""
    return Trained("ours, paper's form", sized(paper_lidar(), size), data)


def default_form(size: Size, data: Data) -> Trained:
    """What we add, without a teacher."""
    return Trained("ours, default form", sized(default(), size), data)


def small_form(size: Size, data: Data) -> Trained:
    """What we add, as our preset `small` has it, without a teacher: for short runs."""
    return Trained("ours", sized(small(), size), data)


def oracle(size: Size, data: Data) -> Trained:
    """The paper's network, taught the truth."""
    return Trained(ORACLE, sized(paper_lidar(), size), data, teacher="truth")


def paper_oracle(taught: Trained) -> Trained:
    """An oracle as the paper has it: no pose is learned, shapes are measured in the true frame."""
    assert isinstance(taught.recipe, Recipe)
    recipe = shape_oracle(taught.recipe)
    name = "oracle, shape alone (the paper's)"
    return replace(taught, name=name, recipe=recipe, answer="canonical")


def aligned(row: Trained) -> Trained:
    """DPC as its authors judge it: the same weights."""
    return replace(row, name=f"{row.name} (pre-aligned)", answer="canonical")


def flat(base: Trained, name: str) -> Trained:
    """The paper's "Ours*": distances are those in the image."""
    assert isinstance(base.recipe, Recipe)
    loss = base.recipe.loss
    loss = replace(loss, projection=replace(loss.projection, flat=True))
    return replace(base, name=name, recipe=replace(base.recipe, loss=loss))


def views_form(size: Size, data: Data) -> Trained:
    """The paper's method on depth views."""
    return Trained("ours, paper's form", sized(paper_views(), size), data)


def views_oracle(size: Size, data: Data) -> Trained:
    """The paper's network on depth views, taught the truth."""
    return Trained(ORACLE, sized(paper_views(), size), data, teacher="truth")


def dpc_views(size: Size, data: Data) -> tuple[Trained, Trained]:
    """DPC, and DPC with a translation, on depth views."""
    return (
        Trained("DPC", sized_dpc(dpc(), size), data),
        Trained("DPC-dagger", sized_dpc(dpc_dagger(), size), data),
    )


def dpc_drives(size: Size, data: Data) -> Trained:
    """DPC as the paper adapts it to LiDAR."""
    return Trained("DPC-LIDAR", sized_dpc(dpc_lidar(), size), data)
