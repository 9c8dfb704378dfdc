# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The curves of a training, from the log that it left: loss, held-out loss, and truth held out.

python experiments/curve_picture.py RUN OUT.svg
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import matplotlib as mpl
import numpy as np
import tyro

from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError
from wildshape.io.atomic import atomic_write
from wildshape.report.page.curves import whole_entries

_TRUTH = {
    "validation/truth_cd": ("CD, m", 1.0),
    "validation/truth_acc30": ("within 30°, %", 100.0),
    "validation/truth_rot_median_deg": ("rotation, degrees", 1.0),
    "validation/truth_trans_median_m": ("translation, m", 1.0),
}
_LOSSES = {
    "observation": "observation",
    "projection": "projection",
    "pose": "pose, taught",
    "coverage": "coverage, taught",
    "precision": "precision, taught",
    "validation/observation": "observation, held out",
    "validation/projection": "projection, held out",
}
_BATCHES = 10  # lines of the log that a point of the curve is the mean of


@dataclass(frozen=True)
class Settings:
    """Draw the curves of one run.

    Attributes:
        run: its folder.
        out: an SVG.
    """

    run: Annotated[Path, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]


def main(settings: Settings) -> None:
    """Draw.

    Raises:
        BadInputError: the log has none of the curves.
    """
    log = settings.run / "log.jsonl"
    entries = list(whole_entries(log))
    if not any(key in entry for key in _LOSSES for entry in entries):
        raise BadInputError(f"{log}: holds no losses in metres; name a run that is not DPC's.")
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "wildshape", "font.size": 8}):
        draw(settings.out, entries)


def series(entries: list[dict[str, Any]], key: str, of: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Steps and what was measured at them, each the mean `of` so many; a rest is left out."""
    found = np.array([(e["step"], e[key]) for e in entries if key in e]).reshape(-1, 2)
    steps, values = found[: len(found) // of * of].reshape(-1, of, 2).mean(axis=1).T
    return steps, values


def draw(out: Path, entries: list[dict[str, Any]]) -> None:
    mpl.use("agg")
    from matplotlib import pyplot as plt
    from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

    figure, panels = plt.subplots(1, 5, figsize=(13, 2.8), layout="constrained")
    for key, name in _LOSSES.items():
        if not any(key in entry for entry in entries):
            continue
        of = 1 if key.startswith("validation/") else _BATCHES
        panels[0].plot(*series(entries, key, of), lw=1, label=name)
    panels[0].set_title("terms of the loss, m")
    panels[0].set_yscale("log")
    panels[0].legend(fontsize=6, frameon=False)
    for panel, (key, (title, factor)) in zip(panels[1:], _TRUTH.items()):
        steps, values = series(entries, key)
        panel.plot(steps, factor * values, "o-", ms=2, lw=1, c="#0072b2")
        panel.set_title(f"held out: {title}")
    for panel in panels:
        panel.set_xlabel("step")
        panel.set_xscale("log")
        panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.xaxis.set_major_formatter(EngFormatter(sep=""))
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.spines[["top", "right"]].set_visible(False)
    with atomic_write(out) as file:
        figure.savefig(file, format="svg", metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings, description=__doc__))
