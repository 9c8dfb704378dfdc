# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where the error lies: an evaluation of simulated drives, told apart by kind of vehicle.

wildshape evaluate DATA --out EVALUATION
python experiments/by_kind.py --data DATA --evaluation EVALUATION
"""

import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from wildshape.io.store.store import open_store


@dataclass(frozen=True)
class Settings:
    """What to read.

    Attributes:
        data: simulated tracks, as a packed store.
        evaluation: folder that `wildshape evaluate` wrote for them.
        method: row to look at.
    """

    data: Path
    evaluation: Path
    method: str = "wildshape"


def main(settings: Settings) -> None:
    """Print a table: a row a kind."""
    words = {track.name: track.source.split()[-1] for track in open_store(settings.data)}
    kinds = {name: word.split("_")[0] for name, word in words.items()}  # of meshes, the category
    runs = json.loads((settings.evaluation / "scores.json").read_text("utf-8"))["runs"]
    methods = [m for run in runs for m in run["methods"] if m["name"] == settings.method]
    completed = _by_kind(methods, kinds, "completions")
    registered = _by_kind(methods, kinds, "registrations")
    names = sorted(completed, key=lambda kind: -len(completed[kind]))
    print("| kind | scans | CD, m | precision | coverage | acc 30, % | rot, deg | trans, m |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for kind in names:
        errors = [row["error"] for row in completed[kind]]
        precision, coverage = (np.mean([e[k] for e in errors]) for k in ("precision", "coverage"))
        rows = registered[kind]
        angle = np.asarray([row["rotation_deg"] for row in rows])
        apart = np.median([row["translation_m"] for row in rows])
        print(
            f"| {kind} | {len(errors)} | {precision + coverage:.3f} | {precision:.3f} |"
            f" {coverage:.3f} | {100 * np.mean(angle <= 30):.1f} | {np.median(angle):.2f} |"
            f" {apart:.3f} |"
        )


def _by_kind(methods: list[Any], kinds: dict[str, str], what: str) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = defaultdict(list)
    for method in methods:
        for row in method[what]:
            found[kinds[row["track"]]].append(row)
    return found


if __name__ == "__main__":
    main(tyro.cli(Settings))
