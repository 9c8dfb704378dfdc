# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The codes of test objects in a plane, each drawn as its true shape (paper, t-SNE figure)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from experiments.tables.data import store_of
from experiments.tables.make import cost_of
from experiments.tables.rows import default_form
from experiments.tables.sources import Sources
from experiments.tables.train import Workshop, model_of
from experiments.tables.tsne import tsne

from wildshape.evaluation.pictures import project
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import atomic_write
from wildshape.io.store.store import open_store
from wildshape.method.choose_hypothesis import network_input

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MOST, _DRAWN, _WIDTH, _WIDEST = 200, 400, 0.07, 0.1


def draw(shop: Workshop, sources: Sources, path: Path) -> dict[str, object]:
    """Write the figure; returns what is drawn."""
    row = default_form(sources.size, sources.drives("train"))
    models = [model_of(shop, row, seed) for seed in range(sources.size.seeds)]
    chosen = min(models, key=cost_of)
    store = open_store(store_of(shop.folder, sources.drives("test")))
    count = min(len(store), _MOST)
    tracks = [store.track(index) for index in range(count)]
    codes = _codes(load(chosen.path), [track.scans[track.middle] for track in tracks])
    places = tsne(codes)
    with atomic_write(path) as file:
        _picture(places, [np.asarray(track.shape) for track in tracks]).savefig(
            file, dpi=110, format="webp"
        )
    kinds = [track.source for track in tracks]
    return {"method": row.name, "objects": count, "places": places.tolist(), "sources": kinds}


@torch.inference_mode()
def _codes(model: Predictor, scans: list[np.ndarray]) -> np.ndarray:
    settings = model.settings
    inputs = network_input(scans, settings.input_points, settings.sensor, settings.facing)
    return model.network.encode(inputs.scans).double().numpy()


def _picture(places: np.ndarray, shapes: list[np.ndarray]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 10))
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set_axis_off()
    low, high = places.min(0), places.max(0)
    width = min(_WIDEST, _WIDTH * (_MOST / len(shapes)) ** 0.5)
    for place, shape in zip((places - low) / (high - low), shapes, strict=True):
        _thumbnail(ax, place, shape, width)
    ax.set_xlim(-0.8 * width, 1 + 0.8 * width)
    ax.set_ylim(-0.8 * width, 1 + 0.8 * width)
    return figure


def _thumbnail(ax: Axes, place: np.ndarray, shape: np.ndarray, width: float) -> None:
    """The true shape from the fixed viewpoint, the same width for every object."""
    seen = project(shape[:: max(1, len(shape) // _DRAWN)])
    seen = seen[np.argsort(seen[:, 2])]
    x, y = (place + seen[:, :2] * width / np.ptp(seen[:, 0])).T
    ax.scatter(x, y, c=seen[:, 2], s=20 * width, cmap="viridis", linewidths=0)
