# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Real cars of KITTI raw, where the paper has SemanticKITTI (its tables 2b and 3b).

Nothing is trained on them but the row that says so, and that row uses no label.
"""

from experiments.tables.rows import REGISTERING, baselines, default_form, paper_form
from experiments.tables.sources import Sources
from experiments.tables.table import PROTOCOLS, Block, Shipped, Table, Trained

from wildshape.evaluation.paper import KITTI, LIDAR_ROWS


def table(sources: Sources) -> Table:
    """Trained on simulated drives and measured on real cars; fine-tuned on them; shipped."""
    size, real = sources.size, sources.real_cars()
    ours = default_form(size, sources.drives("train"))
    rows = (
        paper_form(size, sources.drives("train")),
        ours,
        Trained("ours, fine-tuned on these scans", ours.recipe, real, start=ours),
        Shipped(),
        *baselines("one-scan", *REGISTERING),
    )
    paper = tuple(row for row in LIDAR_ROWS if row.data == KITTI)
    notes = (
        "Truth is accumulated by the labelled boxes, which are good to about 5 cm and 1.5 degrees;"
        " CD is against mirrored truth, CD partial against what the sensor saw.",
        "The paper's rows are of SemanticKITTI, against partial truth.",
        "Fine-tuned: on the scans that are measured, without labels, as many steps again.",
    )
    block = Block("Real cars of KITTI raw", real, rows, paper, PROTOCOLS)
    return Table("Real cars (paper, tables 2b and 3b)", (block,), size.seeds, notes)
