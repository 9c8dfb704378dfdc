# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Bars on a logarithmic axis, a panel a case: each method's median and how often ours fits in."""

from pathlib import Path
from typing import Any

from wildshape.io.atomic import atomic_write

_OURS, _OTHERS = "#2a7f62", "#b9c0c7"


def draw(path: Path, rows: list[dict[str, Any]], unit: str, caption: str) -> None:
    """Write one SVG; the first method of each case is ours."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.fonttype"] = "none"
    matplotlib.rcParams["svg.hashsalt"] = "wildshape"
    from matplotlib import pyplot as plt

    cases = list(dict.fromkeys(row["case"] for row in rows))
    held = [[row for row in rows if row["case"] == case] for case in cases]
    heights = [len(panel) + 1.2 for panel in held]
    figure, axes = plt.subplots(
        len(cases), figsize=(8, 0.3 * sum(heights) + 0.5), height_ratios=heights, squeeze=False
    )
    for axis, case, panel in zip(axes[:, 0], cases, held):
        _panel(axis, case, panel, unit)
    figure.text(0.01, 0.002, caption, fontsize=6, color="#777777")
    figure.tight_layout()
    with atomic_write(path) as file:
        figure.savefig(file, format="svg", metadata={"Date": None})
    plt.close(figure)


def number(value: float) -> str:
    """Three digits, and no powers of ten."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _panel(axis, case: str, rows: list[dict[str, Any]], unit: str) -> None:
    values, names = [row["median"] for row in rows], [row["method"] for row in rows]
    colours = [_OURS] + [_OTHERS] * (len(rows) - 1)
    bars = axis.barh(range(len(rows)), values, color=colours, log=True)
    labels = [
        f" {number(v)}" + (f" ({number(v / values[0])} x)" if i else "")
        for i, v in enumerate(values)
    ]
    axis.bar_label(bars, labels, fontsize=8)
    axis.set_yticks(range(len(rows)), names, fontsize=8)
    axis.set_ylim(len(rows) - 0.4, -0.6)
    axis.set_xlim(min(values) / 2, max(values) * 6)
    axis.set_title(f"{case}: {unit}, {rows[0]['clock']}", fontsize=9, loc="left")
    axis.tick_params(axis="x", which="both", bottom=False, labelbottom=False)
    for side in ("top", "right", "bottom"):
        axis.spines[side].set_visible(False)
