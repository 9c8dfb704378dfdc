# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Sensitivity to the seed (paper, supplement, section 6): mean, deviation, the seed selected."""

from experiments.tables.rows import baselines, default_form, paper_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Table

from wildshape.evaluation.paper import SEED_ROWS


def table(sources: Sources) -> Table:
    """The paper's form and ours, as recorded and turned."""
    size, data = sources.size, sources.drives("train")
    rows = (paper_form(size, data), default_form(size, data), *baselines("identity"))
    block = Block(
        "Simulated drives past cars", sources.drives("test"), rows, SEED_ROWS, ("none", "yaw")
    )
    notes = (
        "The best seed by the truth is never printed; the paper's tables print the best of 5.",
        "The paper's CD on SemanticKITTI, 0.20 ± 0.09 m, is against partial truth.",
    )
    return Table("Seeds (paper, supplement)", (block,), size.seeds, notes)
