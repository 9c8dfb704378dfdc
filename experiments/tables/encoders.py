# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Any point network can be the encoder (paper, section 4.1): those that there are."""

from dataclasses import replace

from experiments.tables.given import Given
from experiments.tables.rows import default_form
from experiments.tables.table import Block, Table, Trained

_WIDTHS = ((32, 64, 128, 256), (64, 128, 256, 512), (128, 256, 512, 1024))


def table(given: Given) -> Table:
    """PCN's encoder in three widths."""
    base = default_form(given.size, given.drives("train"))
    rows = tuple(_with(base, widths) for widths in _WIDTHS)
    block = Block("Simulated drives past cars", given.drives("test"), rows, (), ("none", "yaw"))
    note = "PointNet++ and DGCNN are not in the package yet: the network's config has PCN alone."
    return Table("Encoders", (block,), given.size.ablation_seeds, (note,))


def _with(base: Trained, widths: tuple[int, int, int, int]) -> Trained:
    recipe = replace(base.recipe, network=replace(base.recipe.network, encoder=widths))
    return Trained(f"PCN {'-'.join(map(str, widths))}", recipe, base.data)
