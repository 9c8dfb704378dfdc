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

from wildshape.cli.main import in_a_sentence
from wildshape.evaluation.tables import pipe_table
from wildshape.io.store.store import open_store

_COLUMNS = (
    "kind", "scans", "CD, m", "precision", "coverage", "acc 30, %", "rot, deg", "trans, m"
)  # fmt: skip


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


def table(data: Path, evaluation: Path, method: str = "wildshape") -> str:
    """A row a kind, as markdown.

    Args:
        data: simulated tracks, as a packed store.
        evaluation: folder that `wildshape evaluate` wrote for them.
        method: row to look at.
    """
    words = {track.name: track.source.split()[-1] for track in open_store(data)}
    kinds = {name: word.split("_")[0] for name, word in words.items()}  # of meshes, the category
    runs = json.loads((evaluation / "scores.json").read_text("utf-8"))["runs"]
    methods = [m for run in runs for m in run["methods"] if m["name"] == method]
    completed = _by_kind(methods, kinds, "completions")
    registered = _by_kind(methods, kinds, "registrations")
    rows = []
    for kind in sorted(completed, key=lambda kind: -len(completed[kind])):
        errors = [row["error"] for row in completed[kind]]
        precision, coverage = (np.mean([e[k] for e in errors]) for k in ("precision", "coverage"))
        angle = np.asarray([row["rotation_deg"] for row in registered[kind]])
        apart = np.median([row["translation_m"] for row in registered[kind]])
        shares = (precision + coverage, precision, coverage)
        pose = (f"{100 * np.mean(angle <= 30):.1f}", f"{np.median(angle):.2f}", f"{apart:.3f}")
        rows.append([kind, str(len(errors)), *(f"{share:.3f}" for share in shares), *pose])
    return pipe_table(_COLUMNS, rows)


def _by_kind(methods: list[Any], kinds: dict[str, str], what: str) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = defaultdict(list)
    for method in methods:
        for row in method[what]:
            found[kinds[row["track"]]].append(row)
    return found


if __name__ == "__main__":
    with in_a_sentence():
        settings = tyro.cli(Settings)
        print(table(settings.data, settings.evaluation, settings.method))
