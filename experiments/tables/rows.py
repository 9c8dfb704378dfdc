# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rows that several tables share."""

from experiments.tables.data import Data
from experiments.tables.size import Size, sized
from experiments.tables.table import Baseline, Trained

from wildshape.training.recipes import PRESETS, default, paper_lidar, paper_views

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


def oracle(size: Size, data: Data) -> Trained:
    """The paper's network, taught the truth."""
    return Trained("oracle", sized(paper_lidar(), size), data, teacher="truth")


def views_form(size: Size, data: Data) -> Trained:
    """The paper's method on depth views."""
    return Trained("ours, paper's form", sized(paper_views(), size), data)


def views_oracle(size: Size, data: Data) -> Trained:
    """The paper's network on depth views, taught the truth."""
    return Trained("oracle", sized(paper_views(), size), data, teacher="truth")


def dpc_rows(size: Size, data: Data) -> tuple[Trained, ...]:
    """DPC in the forms that are presets of `wildshape train`; none where there is none."""
    names = [name for name in PRESETS if name.startswith("dpc")]
    return tuple(Trained(name, sized(PRESETS[name](), size), data) for name in names)
