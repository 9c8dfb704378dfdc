# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Any point network can be the encoder (paper, section 4.1): PCN's, PointNet++ and DGCNN."""

from dataclasses import replace

from experiments.tables.given import Given
from experiments.tables.rows import default_form
from experiments.tables.table import Block, Table, Trained

from wildshape.models.shapepose import Backbone
from wildshape.training.recipes import with_encoder

_NAMES: dict[Backbone, str] = {"pcn": "PCN", "pointnet2": "PointNet++", "dgcnn": "DGCNN"}


def table(given: Given) -> Table:
    """Each at the same widths, and PCN's at twice them."""
    base = default_form(given.size, given.drives("train"))
    rows = (*(_with(base, backbone) for backbone in _NAMES), _wider(base))
    block = Block("Simulated drives past cars", given.drives("test"), rows, (), ("none", "yaw"))
    note = (
        "Ours without batch normalisation, so that each scan is coded on its own; the paper prints"
        " PCN's alone."
    )
    return Table("Encoders", (block,), given.size.ablation_seeds, (note,))


def _with(base: Trained, backbone: Backbone) -> Trained:
    return Trained(_NAMES[backbone], with_encoder(base.recipe, backbone), base.data)


def _wider(base: Trained) -> Trained:
    network = base.recipe.network
    a, b, c, d = network.encoder
    wide = replace(base.recipe, network=replace(network, encoder=(2 * a, 2 * b, 2 * c, 2 * d)))
    return Trained("PCN, twice as wide", wide, base.data)
