# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How near SemanticKITTI's labels come to the paper's counts, under each reading of its words.

python experiments/semantic_kitti_counts.py DATASET

Gu et al.: 659 / 229 instances and 51,186 / 16,299 scans (train / test) of parked vehicles with 512
points on average. They do not say which classes are vehicles, nor which scans count in the average.
Reads labels alone (data_odometry_labels.zip, 179 MB); minutes. What `convert` writes is the row
"car bus truck other-vehicle, scans of >= 100 points", less what it counts as left out.
"""

from pathlib import Path

import tyro

from wildshape.cli.main import in_a_sentence
from wildshape.datasets.semantic_kitti.labels import (
    LABELS_CURE,
    VEHICLES,
    categories_of,
    count_points,
)
from wildshape.datasets.semantic_kitti.reader import SPLITS, SemanticKitti
from wildshape.datasets.semantic_kitti.sequence import find_sequences
from wildshape.datasets.tracks.parts import numbered

PAPER = {"train": (659, 51186), "test": (229, 16299)}
MEAN = 512


def main(root: tyro.conf.Positional[Path]) -> None:
    """Print the counts of each split under each reading.

    Args:
        root: SemanticKITTI's folder.
    """
    SemanticKitti(root).parts()  # refuses what has no labels
    found = find_sequences(root)
    for split in ("train", "test"):
        names = [name for name in SPLITS[split] if name in found]
        missing = [name for name in SPLITS[split] if name not in found]
        chosen = categories_of(VEHICLES, "parked")
        objects = [
            (chosen[label & 0xFFFF].category, list(points.values()))
            for name in names
            for label, points in count_points(_label_files(found[name]), chosen).items()
        ]
        instances, scans = PAPER[split]
        print(f"{split}: the paper has {instances} instances, {scans} scans", end="")
        print(f"; sequences missing here: {' '.join(missing)}" if missing else "")
        for categories in (("car",), ("car", "truck"), VEHICLES):
            for least in (1, 50, 100, 200):
                row = count([points for kind, points in objects if kind in categories], least)
                print(f"  {' '.join(categories)}, scans of >= {least} points: {row}")


def _label_files(sequence: Path) -> dict[int, Path]:
    return numbered(sequence / "labels", ".label", f"no .label files; {LABELS_CURE}")


def count(objects: list[list[int]], least: int) -> str:
    kept = [[n for n in points if n >= least] for points in objects]
    kept = [points for points in kept if points and sum(points) >= MEAN * len(points)]
    return f"{len(kept)} instances, {sum(map(len, kept))} scans"


if __name__ == "__main__":
    with in_a_sentence():
        tyro.cli(main)
