# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How well `wildshape drive` finds the vehicles of simulated drives, and how long it takes.

python -m experiments.drives --out DRIVES --first 21 --count 20 --scans 60

simulates, runs and measures one drive after the other and writes `table.md` into
`DRIVES/21-40-of-60-scans`. A killed run goes on with the same command: finished drives are not
done again by the same weights, a half-finished one is begun again, as its time is measured. The
table names every commit that found a part of it. With `--cad CAD` the vehicles are meshes of split
`test`, of forms that nothing was trained on or fitted to.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tyro
from experiments.meshes import unseen_vehicles
from experiments.tables.command import commit

from wildshape.cli.main import in_a_sentence
from wildshape.io.atomic import write_text
from wildshape.io.output import MARKER
from wildshape.method.checkpoint import fingerprint

_HEADING = (
    "seed",
    "labels",
    "AP BEV 0.5",
    "AP BEV 0.7",
    "AP 3D 0.5",
    "AP 3D 0.7",
    "recall at 90 %",
    "tracks a vehicle",
    "impure",
    "drift, %",
    "s a second",
)
_WAY = 9  # columns that one drive has and all together have not
_PERIOD_S = 0.1


@dataclass(frozen=True)
class Settings:
    """What to run.

    Attributes:
        out: folder; in it each choice of drives has one, with what is found and the table.
        first: seed of the first drive.
        count: drives.
        scans: of each.
        workers: processes of each.
        sensor: whose scans they are.
        cad: folder of CAD meshes with a manifest; else vehicles are procedural.
    """

    out: Path
    first: int = 1
    count: int = 3
    scans: int = 80
    workers: int = 2
    sensor: Literal["hdl64", "hdl32", "os1-128"] = "hdl64"
    cad: Path | None = None


def main(settings: Settings) -> None:
    """Run every drive, then write and print the table."""
    seeds = [str(settings.first + number) for number in range(settings.count)]
    everything = f"{seeds[0]}-{seeds[-1]}"
    named = "" if settings.sensor == "hdl64" else f"-{settings.sensor}"
    vehicles: tuple[str, ...] = ()
    if settings.cad is not None:
        meshes = settings.out / "cad-vehicles"
        unseen_vehicles(settings.cad, meshes)
        named, vehicles = f"{named}-cad", ("--meshes", str(meshes))
    out = settings.out / f"{everything}-of-{settings.scans}-scans{named}"
    by = out / f"by-{fingerprint(None)}"
    for seed in seeds:
        street, found = out / "streets" / seed, by / "found" / seed
        drive = ("--drive", "--scans", str(settings.scans), "--seed", seed)
        _step(street, "simulate", str(street), *drive, "--sensor", settings.sensor, *vehicles)
        scans = str(street / "velodyne" / "0000")
        workers = ("--workers", str(settings.workers))
        _step(found, "drive", scans, "--out", str(found), *workers, "--overwrite")
        _measure(by / "evaluation" / seed, found, street)
    _measure(by / "evaluation" / everything, by / "found", out / "streets")
    text = _table(by, seeds, everything, settings.scans)
    write_text(out / "table.md", text)
    print(text, end="")


def _measure(evaluation: Path, found: Path, labels: Path) -> None:
    line = ("evaluate-drive", str(found), "--labels", str(labels), "--out", str(evaluation))
    _step(evaluation, *line)


def _step(folder: Path, *line: str) -> None:
    """Run a command unless what it writes is finished."""
    marker = folder / MARKER
    if not marker.is_file() or json.loads(marker.read_text("utf-8"))["status"] != "finished":
        subprocess.run((sys.executable, "-m", "wildshape.cli", *line), check=True)


def _table(out: Path, seeds: list[str], everything: str, scans: int) -> str:
    """A line a drive, their mean and standard deviation, all drives as one; then the stages."""
    records = [_read(out / "found" / seed / MARKER) for seed in seeds]
    results = [record["result"] for record in records]
    measured = [_figures(out / "evaluation" / seed) for seed in seeds]
    spent = [sum(result["seconds"].values()) / (scans * _PERIOD_S) for result in results]
    rows = np.array([(*of, seconds) for of, seconds in zip(measured, spent)], float)
    pooled = _figures(out / "evaluation" / everything)
    lines = ["| " + " | ".join(_HEADING) + " |", "| --- |" + " ---: |" * (len(_HEADING) - 1)]
    lines += [_line(seed, row) for seed, row in zip(seeds, rows)]
    lines.append(_line("mean", np.nanmean(rows, axis=0)))
    lines.append(_line("deviation", np.nanstd(rows, axis=0, ddof=min(1, len(rows) - 1))))
    lines.append(_line("all as one", pooled[: _WAY - 1]))
    stages = {
        name: np.mean([of["seconds"].get(name, 0.0) for of in results])
        for name in results[0]["seconds"]
    }
    said = ", ".join(
        f"{name} {seconds / (scans * _PERIOD_S):.2f}" for name, seconds in stages.items()
    )
    made = ", ".join(sorted({commit(record["provenance"]["code"]) for record in records}))
    return "\n".join(lines) + (
        f"\n\nSeconds a second of drive, mean, by stage: {said}.\n\nFound at commit {made}.\n"
    )


def _figures(evaluation: Path) -> tuple[float, ...]:
    """The columns of one evaluation but the last."""
    metrics = _read(evaluation / "metrics.json")
    ours = metrics["methods"]["wildshape"]
    bev, bev7, space, space7 = (100 * of["average_precision"] for of in ours["detections"])
    purity, way = ours["purity"], metrics["trajectories"][0]
    return (
        ours["labels"],
        bev,
        bev7,
        space,
        space7,
        100 * ours["detections"][0]["recall_at_90"],
        purity["tracks_per_vehicle"] or np.nan,
        purity["impure_tracks"],
        way["drift_percent"] or np.nan,
    )


def _read(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def _line(name: str, values: Sequence[float] | np.ndarray) -> str:
    digits = (0, 1, 1, 1, 1, 1, 2, 0, 2, 1)
    cells = [f"{value:.{digit}f}" for value, digit in zip(values, digits)]
    cells += [""] * (len(_HEADING) - 1 - len(cells))
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
