# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of an evaluation: clouds from one fixed viewpoint, and how the errors spread."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from wildshape.evaluation.examples import Example
from wildshape.evaluation.metrics import ACCURATE_DEG
from wildshape.evaluation.results import MethodScores, Results
from wildshape.evaluation.risk_coverage import risk_coverage
from wildshape.evaluation.summary import stated
from wildshape.io.atomic import atomic_write
from wildshape.io.progress import literal
from wildshape.records import Points

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# From the front left and above, in the object's frame: orthographic, so sizes compare.
AZIMUTH_DEG, _ELEVATION_DEG = 40.0, 22.0
_SEEN, _MADE = ("one scan", "truth"), ("completed", "fused")
_MAX_DRAWN = 6000


def project(
    points: Float[np.ndarray, "n 3"], azimuth_deg: float = AZIMUTH_DEG
) -> Float[np.ndarray, "n 3"]:
    """Right, up and towards the viewer, metres, from a little above; z is up in `points`."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(_ELEVATION_DEG)
    flat = math.cos(elevation)
    towards = np.asarray((flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)))
    right = np.asarray((-math.sin(azimuth), math.cos(azimuth), 0.0))
    return points @ np.stack((right, np.cross(towards, right), towards), axis=1)


def draw_examples(examples: Sequence[Example]) -> Figure:
    """A row an object: scan, truth, what its rivals made, the completion, the fused track."""
    from matplotlib.figure import Figure

    rivals = tuple(examples[0].rivals)
    whose = "ours" if rivals else examples[0].method
    panels = (*_SEEN, *rivals, *(f"{whose}, {title}" for title in _MADE))
    figure = Figure(figsize=(3.2 * len(panels), 2.5 * len(examples)), layout="constrained")
    axes = figure.subplots(len(examples), len(panels), squeeze=False)
    for row, example in zip(axes, examples, strict=True):
        _draw_example(row, example)
    for ax, title in zip(axes[0], panels, strict=True):
        ax.set_title(literal(title))
    return figure


def _draw_example(row: Sequence[Axes], example: Example) -> None:
    rivals = example.rivals.values()
    clouds = (example.scan, example.truth, *rivals, example.completed, example.fused)
    for ax, cloud in zip(row, clouds, strict=True):
        draw_panel(ax, cloud, example.truth)
    row[0].set_ylabel(f"{example.label}\nCD {example.cd:.3f} m", fontsize=9)
    name = literal(example.track)
    row[1].text(0.02, 0.97, name, va="top", fontsize=6, transform=row[1].transAxes)


def draw_panel(ax: Axes, cloud: Points | None, truth: Points) -> None:
    """A cloud `(n, 3)` from the fixed viewpoint, framed and coloured as the truth is; metres."""
    low, high = project(truth).min(0)[:2], project(truth).max(0)[:2]
    margin = 0.12 * float((high - low).max())
    ax.set_aspect("equal")
    ax.set_xlim(low[0] - margin, high[0] + margin)
    ax.set_ylim(low[1] - margin, high[1] + margin)
    ax.set_xticks([])
    ax.set_yticks([])
    if cloud is None:
        ax.text(0.5, 0.5, "does not register", ha="center", transform=ax.transAxes)
        return
    _draw_cloud(ax, cloud, (float(truth[:, 2].min()), float(truth[:, 2].max())))
    ax.set_xlabel(f"{len(cloud)} points", fontsize=8)


def _draw_cloud(ax: Axes, cloud: Points, heights: tuple[float, float]) -> None:
    step = -(-len(cloud) // _MAX_DRAWN)
    seen = project(cloud[::step])
    order = np.argsort(seen[:, 2])
    height = cloud[::step, 2][order]
    x, y = seen[order, 0], seen[order, 1]
    low, high = heights
    dot = 1.6 * min(4.0, max(1.0, math.sqrt(_MAX_DRAWN / max(1, len(cloud)))))  # few are larger
    ax.scatter(x, y, c=height, s=dot, cmap="viridis", vmin=low, vmax=high, linewidths=0)


def draw_errors(results: Results) -> Figure:
    """Share of scans below an error: rotation with the 30 degree bar, and CD."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.8), layout="constrained")
    rotation, cd = figure.subplots(1, 2)
    for i, scores in enumerate(results.methods):
        _draw_shares(rotation, [r.rotation_deg for r in scores.registrations], scores, i)
        cds = [r.error.cd for r in scores.completions for _ in range(r.scans)]  # as in the table
        _draw_shares(cd, cds, scores, i)
    rotation.axvline(ACCURATE_DEG, color="0.6", linestyle=":", linewidth=1)
    rotation.set_xscale("log")
    rotation.set_xlim(0.1, 180)
    ticks = (0.1, 0.3, 1, 3, 10, 30, 180)
    rotation.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    rotation.minorticks_off()
    rotation.set_xlabel("rotation error, degrees")
    cd.set_xlim(left=0)
    cd.set_xlabel("Chamfer distance, m")
    for ax in (rotation, cd):
        _finish(ax)
    return figure


def _draw_shares(ax: Axes, errors: list[float], scores: MethodScores, colour: int) -> None:
    if not errors:
        return
    shares = 100 * np.arange(len(errors) + 1) / len(errors)
    x = np.concatenate(([0.0], np.sort(errors)))
    ax.step(x, shares, where="post", label=_listed(scores.name), color=f"C{colour}")


def _listed(name: str) -> str:
    """As a legend has it: matplotlib's leaves out what begins with an underscore."""
    return literal(f" {name}" if name.startswith("_") else name)


def _finish(ax: Axes) -> None:
    ax.set_ylim(0, 102)
    ax.set_ylabel("scans below it, %")
    ax.grid(alpha=0.3)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=8, frameon=False, loc="best")


def draw_confidence(results: Results) -> Figure | None:
    """Mean CD of the surest scans; None where no method states a confidence."""
    from matplotlib.figure import Figure

    found = {scores.name: stated(scores.completions) for scores in results.methods}
    rows = {name: pair for name, pair in found.items() if pair[0]}
    if not rows:
        return None
    figure = Figure(figsize=(5.4, 3.8), layout="constrained")
    ax = figure.subplots()
    for i, (name, (confidence, cd)) in enumerate(rows.items()):
        orders = ((name, confidence, "-"), (f"{name}, perfect order", [-one for one in cd], ":"))
        for label, order, style in orders:
            curve = risk_coverage(order, cd)
            assert curve is not None
            shares = 100 * np.asarray(curve.coverage)
            ax.plot(shares, curve.risk, color=f"C{i}", linestyle=style, label=_listed(label))
    ax.set_xlabel("scans kept, the surest first, %")
    ax.set_ylabel("their mean Chamfer distance, m")
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8, frameon=False)
    return figure


def write_figures(folder: Path, results: Results, examples: Sequence[Example]) -> list[Path]:
    """Write `errors.png`, and `confidence.png` and `examples.png` where there is what they show."""
    drawn = {"errors.png": draw_errors(results)}
    confidence = draw_confidence(results)
    if confidence is not None:
        drawn["confidence.png"] = confidence
    if examples:
        drawn["examples.png"] = draw_examples(examples)
    for name, figure in drawn.items():
        with atomic_write(folder / name) as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # names in scripts that matplotlib's font lacks
            figure.savefig(file, format="png", dpi=130)
    return [folder / name for name in drawn]
