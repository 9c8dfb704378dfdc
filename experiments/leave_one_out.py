# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What training on labelled objects' scans, without their labels, does to one that was left out.

    wildshape convert kitti-raw KITTI_RAW kitti --every 2
    python -m experiments.leave_one_out kitti --out RUN

Each object is left out in turn; the model is adapted to the others as `wildshape drive --adapt`
does. Labels only measure. Stopped, the command goes on; RUN is of one data set.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro
from experiments.labelled_boxes import COLUMNS, errors, labelled, shown, upright

import wildshape
from wildshape.cli.main import in_a_sentence
from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.examples import Example
from wildshape.drives.adapting.fine_tuning import taught
from wildshape.drives.adapting.measures import measure
from wildshape.drives.adapting.second_pass import like
from wildshape.inference.predictor import Predictor
from wildshape.method.checkpoint import fingerprint
from wildshape.records import Track


@dataclass(frozen=True)
class Settings:
    """What is adapted to what.

    Attributes:
        data: tracks with labelled sizes and poses.
        out: folder to work in.
        model: checkpoint or name of shipped weights.
        steps: of each training.
        most: objects that are left out in turn.
    """

    data: tyro.conf.Positional[Path]
    out: Path
    model: str = "default"
    steps: int = 300
    most: int = 100


def main(settings: Settings) -> None:
    """Print a line an object, and the means before and after."""
    torch.set_num_threads(1)
    base, tracks = wildshape.load(settings.model), labelled(settings.data)
    config = AdaptConfig(steps=settings.steps)
    examples = [_example(track, base).some(config.scans) for track in tracks]
    before, after, kept = [], [], 0
    for i, track in enumerate(tracks[: settings.most]):
        others, own = [*examples[:i], *examples[i + 1 :]], [examples[i]]
        folder = settings.out / fingerprint(Path(settings.model)) / track.name
        folder.mkdir(parents=True, exist_ok=True)
        model = like(base, taught(base, others, folder, config, lambda *_: None))
        was, now = (measure(one, own, config, lambda _: None) for one in (base, model))
        worse = now.worse_than(was)
        kept += not worse
        before.append(_rows(base, track))
        after.append(_rows(model, track))
        said = "; ".join(worse) or "no measure without labels is worse"
        overlaps = " ".join(f"{row[0][9]:.3f}" for row in (before[-1], after[-1]))
        print(f"{track.name}: BEV IoU {overlaps}; {said}", flush=True)
    print(f"\n{len(before)} objects left out in turn, {kept} of them no worse without labels\n")
    print("| boxes | " + " | ".join(COLUMNS) + " |\n| --- |" + " ---: |" * len(COLUMNS))
    for name, rows in (("before", before), ("after", after)):
        for place, of in enumerate(("one scan", "track")):
            means = np.mean([row[place] for row in rows], axis=0)
            print(f"| {name}, {of} | " + " | ".join(map(shown, COLUMNS, means)) + " |")


def _example(track: Track, base: Predictor) -> Example:
    """A track, each scan's front as all of them say."""
    done = base.complete_track(track.scans)
    fronts = torch.stack([one.pose.rotation[:, 0] for one in done]).float().numpy()
    return Example(track.name, track.scans, fronts, moving=False)


def _rows(model: Predictor, track: Track) -> tuple[np.ndarray, np.ndarray]:
    """Errors of its boxes, scan by scan and of all scans together."""
    each, whole = model.complete_many(track.scans), model.complete_track(track.scans)
    alone, together = ([upright(one.box) for one in done] for done in (each, whole))
    return errors(alone, track), errors(together, track)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
