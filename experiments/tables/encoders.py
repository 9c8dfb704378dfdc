# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Any point network can be the encoder (paper, section 4.2): PCN's, PointNet++ and DGCNN."""

from experiments.tables.rows import default_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table, Trained

from wildshape.method.encoders.named import Backbone
from wildshape.training.recipes import with_encoder

_NAMES: dict[Backbone, str] = {"pcn": "PCN", "pointnet2": "PointNet++", "dgcnn": "DGCNN"}


def table(sources: Sources) -> Table:
    """Each at the same widths."""
    base = default_form(sources.size, sources.drives("train"))
    rows = tuple(_with(base, backbone) for backbone in _NAMES)
    block = Block("Simulated drives past cars", sources.drives("test"), rows, (), ("none", "yaw"))
    note = (
        "Ours without batch normalisation, so that each scan is coded on its own; the paper prints"
        " PCN's alone."
    )
    return Table("Encoders", (block,), sources.size.ablation_seeds, (note,))


def _with(base: Trained, backbone: Backbone) -> Trained:
    return Trained(_NAMES[backbone], with_encoder(base.recipe, backbone), base.data)
