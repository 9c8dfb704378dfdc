# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Input, truth, ICP, shape and fusion of the best, the median and the worst object (paper, fig. 4).

The objects are chosen by their CD, never by hand; the seed by its label-free cost.
"""

from pathlib import Path

from experiments.tables.data import store_of
from experiments.tables.given import Given
from experiments.tables.make import selected
from experiments.tables.measure import measure
from experiments.tables.rows import default_form
from experiments.tables.table import Block
from experiments.tables.train import Workshop

from wildshape.baselines.local_icp import LocalIcp
from wildshape.cli.models import load_model
from wildshape.cli.reading import Reading
from wildshape.evaluation.examples import gather
from wildshape.evaluation.figures import draw_examples
from wildshape.inference.method import Learned
from wildshape.io.atomic import atomic_write


def draw(shop: Workshop, given: Given, path: Path) -> dict[str, object]:
    """Write the figure; returns what is drawn."""
    row = default_form(given.size, given.drives("train"))
    block = Block("objects", given.drives("test"), (row,))
    most = given.size.max_scans
    tried = [measure(shop, row, block, "none", seed, most) for seed in range(given.size.seeds)]
    best = selected(row.name, tuple(one for one in tried if one is not None))
    assert best.model is not None
    method = Learned(load_model(best.model.path, shop.device))
    scores = best.results.methods[0]
    examples = gather(
        (track for _, track in Reading(store_of(shop.folder, block.test)).tracks()),
        best.results,
        scores.name,
        method,
        max_scans=most,
        rival=LocalIcp(),
    )
    with atomic_write(path) as file:
        draw_examples(examples).savefig(file, dpi=130, format="png")
    drawn = {example.label: {"track": example.track, "cd_m": example.cd} for example in examples}
    return {"method": scores.name, "rival": LocalIcp().about, "objects": drawn}
