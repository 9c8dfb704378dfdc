# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Input, truth, ICP, DPC, shape and fusion of the best, the median and the worst object.

The paper's figures 3 and 4 and those of its supplement. The objects are chosen by their CD, never
by hand; the seed by its label-free cost. DPC knows no such cost: seed 0.
"""

from pathlib import Path
from typing import cast

from experiments.tables.data import store_of
from experiments.tables.make import Figure, selected
from experiments.tables.measure import Measured, measure, method_of
from experiments.tables.rows import default_form, dpc_drives, dpc_views, views_form
from experiments.tables.sources import Sources
from experiments.tables.table import Block, Row, Shipped, Trained
from experiments.tables.train import Workshop, model_of

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.pairs import Chained
from wildshape.evaluation.examples import Example, gather
from wildshape.evaluation.method import Completer
from wildshape.evaluation.pictures import draw_examples
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import load
from wildshape.io.atomic import atomic_write
from wildshape.io.inputs import open_tracks
from wildshape.simulate.config import Category


def drives(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
    """Cars driven past, by the default form."""
    row = default_form(sources.size, sources.drives("train"))
    block = Block("objects", sources.drives("test"), (row,))
    return _draw(shop, sources, row, block, sources.size.seeds, path)


def kitti(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
    """Real cars, by the weights that the package carries."""
    block = Block("objects", sources.real_cars(), (Shipped(),))
    return _draw(shop, sources, Shipped(), block, 1, path)


def trucks(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
    """Trucks, by the default form trained on cars and fine-tuned on the trucks without labels."""
    cars, data = default_form(sources.size, sources.drives("train")), sources.trucks()
    row = Trained("ours, default form, fine-tuned", cars.recipe, data, start=cars)
    block = Block("objects", data, (row,))
    return _draw(shop, sources, row, block, sources.size.side_seeds, path)


def views_of(category: Category) -> Figure:
    """Depth views of a category, by the paper's form."""

    def views(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
        data = sources.views(category, "train")
        row, (rival, _) = views_form(sources.size, data), dpc_views(sources.size, data)
        block = Block("objects", sources.views(category, "test"), (row,))
        return _draw(shop, sources, row, block, sources.size.side_seeds, path, rival)

    return views


def _draw(
    shop: Workshop,
    sources: Sources,
    row: Row,
    block: Block,
    seeds: int,
    path: Path,
    rival: Trained | None = None,
) -> dict[str, object]:
    """Measure the row, choose the seed and the objects, and write the figure.

    Args:
        shop: where everything is kept.
        sources: size and meshes.
        row: what is drawn.
        block: with the tested data.
        seeds: trainings of the row.
        path: of the figure.
        rival: DPC; by default the paper's for LiDAR, trained on cars driven past.
    """
    most = sources.size.max_scans
    tried = [measure(shop, row, block, "none", seed, most) for seed in range(seeds)]
    best = _selected(row.name, tuple(cast("list[Measured]", tried)))
    examples = _examples(
        shop, block, best, rival or dpc_drives(sources.size, sources.drives("train"))
    )
    with atomic_write(path) as file:
        draw_examples(examples).savefig(file, dpi=130, format="webp")
    drawn = {example.label: {"track": example.track, "cd_m": example.cd} for example in examples}
    name = best.results.methods[0].name
    return {
        "method": name,
        "rival": LocalIcp().about,
        "objects": drawn,
        "measured": best.made,
    }


def _selected(name: str, measured: tuple[Measured, ...]) -> Measured:
    """The only one, or that of the lowest label-free cost."""
    return measured[0] if len(measured) == 1 else selected(name, measured)


def _examples(shop: Workshop, block: Block, best: Measured, rival: Trained) -> list[Example]:
    model = None if best.model is None else best.model.path
    dpc = cast("Completer", method_of(shop, rival, model_of(shop, rival, seed=0)))
    return gather(
        open_tracks(store_of(shop.folder, block.test)),
        best.results,
        best.results.methods[0].name,
        Learned(load(model, shop.device, raw=model is not None)),
        fused_by={"ICP, fused": Chained(LocalIcp())},
        completed_by={f"{rival.name}, completed": dpc},
    )
