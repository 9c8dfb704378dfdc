# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Distributions drawn by matplotlib: bars with the median marked, azimuths as a rose."""

import math
from typing import TYPE_CHECKING

import numpy as np

from wildshape.io.progress import literal
from wildshape.report.content import BLUE, GREY, ORANGE
from wildshape.report.statistics.statistics import Quantity, Statistics

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.projections.polar import PolarAxes
    from matplotlib.ticker import Locator

INK, SOFT, GRID = "#16191d", "#59616c", "#e3e7ec"
_FEW_DECADES = 200
_BINS, _ROSE_BINS, _NAMED, _LONGEST = 28, 24, 8, 34


def number(value: float) -> str:
    """Three digits, thousands apart: `1,234`, `12.3`, `0.456`."""
    if not math.isfinite(value):
        return "\N{EN DASH}"
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{float(f'{value:.3g}'):zg}"


def draw_bars(axes: "Axes", quantity: Quantity) -> None:
    """A histogram; logarithmic where the numbers span decades."""
    tally = quantity.tally
    edges, heights = tally.bars(_BINS)
    axes.bar(
        edges[:-1], 100 * heights, np.diff(edges) * 0.92, align="edge", color=BLUE, linewidth=0
    )
    if tally.spans_decades():
        from matplotlib.ticker import LogLocator

        axes.set_xscale("log")
        if edges[-1] < _FEW_DECADES * edges[0]:  # powers of ten alone may be a single one
            axes.xaxis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: number(value))
    axes.minorticks_off()
    median = tally.quantile(0.5)
    axes.axvline(median, color=ORANGE, linewidth=1.4)
    label = f"median {number(median)}{_unit(quantity)}"
    axes.set_title(label, color=ORANGE, fontsize=9, loc="right", pad=3)
    axes.set_xlabel(f"{quantity.title}{f', {quantity.unit}' if quantity.unit else ''}")
    if tally.whole and not tally.spans_decades():
        axes.xaxis.set_major_locator(_few(whole=True))
    furnish(axes)


def draw_rose(axes: "PolarAxes", quantity: Quantity) -> None:
    """Azimuths around the object, its front up: from where it is seen; areas are shares."""
    edges = np.linspace(-180.0, 180.0, _ROSE_BINS + 1)
    tally = quantity.tally
    middles = (tally.edges[1:] + tally.edges[:-1]) / 2
    shares = np.histogram(middles, edges, weights=tally.counts)[0] / max(tally.count, 1)
    axes.set_theta_zero_location("N")
    axes.bar(
        np.radians(edges[:-1]),
        np.sqrt(shares),
        2 * np.pi / _ROSE_BINS * 0.94,
        align="edge",
        color=BLUE,
        linewidth=0,
    )
    axes.set_xticks(np.radians((0, 90, 180, 270)), ("front", "left", "rear", "right"))
    axes.set_yticks([])
    axes.tick_params(labelsize=8, colors=SOFT, pad=-2)
    axes.grid(color=GRID)
    axes.spines["polar"].set_color(GRID)
    axes.set_xlabel(quantity.title, labelpad=2)


def draw_counts(axes: "Axes", counts: dict[str, int], title: str) -> None:
    """How often each word occurs, the most frequent first, the rest together."""
    shown = list(counts.items())[:_NAMED]
    rest = sum(counts.values()) - sum(count for _, count in shown)
    if rest:
        shown.append((f"{len(counts) - len(shown)} others", rest))
    names = [literal(_short(name)) or "not said" for name, _ in shown]
    values = [count for _, count in shown]
    places = np.arange(len(shown))
    colors = [GREY if i == len(shown) - 1 and rest else BLUE for i in places]
    axes.barh(places, values, 0.7, color=colors, linewidth=0)
    for place, name, value in zip(places, names, values):
        axes.text(0, place - 0.5, f"{name}  {value:,}", fontsize=8, va="center", color=INK)
    axes.set_ylim(_NAMED + 0.2, -1.0)
    axes.set_xlabel(title)
    furnish(axes)
    axes.set_yticks([])
    axes.set_xticks([])
    axes.grid(visible=False)


def furnish(axes: "Axes") -> None:
    """Quiet furniture: no box, light lines, percent on the left."""
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.spines["bottom"].set_color(SOFT)
    axes.tick_params(labelsize=8, colors=SOFT, length=0)
    axes.grid(axis="y", color=GRID)
    axes.set_axisbelow(True)
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    axes.yaxis.set_major_locator(_few())


def panels_of(found: Statistics) -> list[Quantity | tuple[str, dict[str, int]]]:
    """What is drawn, in order: the distributions, then what there is more than one kind of."""
    counted = (("tracks by category", found.categories), ("tracks by sensor", found.sensors))
    told = [(title, counts) for title, counts in counted if len(counts) > 1]
    return [*found.quantities, *told]


def draw_panel(axes: "Axes", panel: Quantity | tuple[str, dict[str, int]]) -> None:
    """Whatever a panel is."""
    if isinstance(panel, tuple):
        draw_counts(axes, panel[1], panel[0])
    elif is_rose(panel):
        draw_rose(axes, panel)  # pyright: ignore[reportArgumentType]
    else:
        draw_bars(axes, panel)


def is_rose(panel: Quantity | tuple[str, dict[str, int]]) -> bool:
    """Whether it is drawn on polar axes: azimuths about the object itself."""
    return (
        isinstance(panel, Quantity) and panel.name == "azimuth" and panel.basis.startswith("object")
    )


def _few(*, whole: bool = False) -> "Locator":
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4, integer=whole)


def _unit(quantity: Quantity) -> str:
    return {"": "", "°": "°"}.get(quantity.unit, f" {quantity.unit}")


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
