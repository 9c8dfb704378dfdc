# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The picture of docs/boxes.md: boxes of a simulated car from one scan and from its track.

python experiments/boxes_picture.py docs/boxes.webp
"""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import matplotlib as mpl
import numpy as np
import tyro
from PIL import Image

from wildshape.cli.main import in_a_sentence
from wildshape.evaluation.metrics import box_score, true_box
from wildshape.geometry.box import EDGES
from wildshape.inference.boxes import carried
from wildshape.inference.predictor import load
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

_CAR, _SHOWN = 78, 5  # a seed that no training has seen, and which scan is drawn
_TRUTH, _ONE, _TRACK, _SCAN = "#009e73", "#d55e00", "#0072b2", "#8a8f98"


@dataclass(frozen=True)
class Settings:
    """Draw one simulated car that no training has seen.

    Attributes:
        out: .webp or .png.
    """

    out: Annotated[Path, tyro.conf.Positional]


def main(settings: Settings) -> None:
    (track,) = simulate_tracks(SimulationConfig(tracks=1, scans=12), seed=_CAR)
    if track.shape is None or track.T_sensor_object is None:
        raise SystemExit("a simulated track has its truth")
    model, i = load(), _SHOWN
    pose, truth = track.T_sensor_object[i], true_box(track.shape, body=True)
    one = model.complete(track.scans[i], track.sensor)
    whole = model.complete_track(track.scans, track.sensor)[i]
    boxes = (
        ("truth", carried(truth, pose), _TRUTH),
        (f"one scan, IoU {box_score(one.box, truth, pose).iou:.2f}", one.box, _ONE),
        (f"track, IoU {box_score(whole.box, truth, pose).iou:.2f}", whole.box, _TRACK),
    )
    # Seen from above and from the side, along the axes of the true object.
    T = pose.inverse()
    clouds = [T.apply_numpy(cloud) for cloud in (track.scans[i], whole.points)]
    draw(
        settings.out,
        clouds,
        [(name, T.apply_numpy(box.corners), color) for name, box, color in boxes],
    )


def draw(out: Path, clouds: list[np.ndarray], boxes: list[tuple[str, np.ndarray, str]]) -> None:
    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 3.5), layout="constrained")
    for panel, (a, b), title in zip(panels, ((0, 1), (0, 2)), ("from above", "from the side")):
        panel.scatter(*clouds[1][:, [a, b]].T, s=0.5, c="#d0d3d8", label="completed")
        panel.scatter(*clouds[0][:, [a, b]].T, s=1.5, c=_SCAN, label="scan")
        for name, box, color in boxes:
            for k, (i, j) in enumerate(EDGES):
                ends = box[[i, j]][:, [a, b]].T
                panel.plot(*ends, c=color, lw=1.6, label=None if k else name)
        panel.set(aspect="equal", title=title, xlabel="m", ylabel="m")
    panels[0].legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=3, frameon=False)
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=90)
    Image.open(buffer).convert("RGB").save(out, quality=85)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
