# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape evaluate`: models and baselines beside each other, by METHOD 8."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from wildshape.baselines.named import NAMES
from wildshape.cli.commands import uncollected
from wildshape.cli.options import (
    DEFAULT_FILES,
    DEFAULT_WORK,
    AsJson,
    Data,
    Device,
    Files,
    OutFolder,
    Overwrite,
    Work,
    listed,
    option,
)

EXAMPLES = (
    "wildshape evaluate test.store --out evaluation",
    "wildshape evaluate test.store --out evaluation --rotate yaw --model runs/cars --track",
    "wildshape evaluate test.store --out seeds --model run0,run1,run2 --as-seeds --baselines none",
)

Models = Annotated[
    tuple[Path, ...],
    listed("M,M", Path),
    option(help="checkpoints, folders of runs, names of shipped weights; else `default`"),
]
Baselines = Annotated[
    tuple[str, ...], listed("A,B", words=1), option(help=f"of {', '.join(NAMES)}; or none")
]


@dataclass(frozen=True)
class Settings:
    """Measure shapes and registration against truth, for models and baselines.

    Writes DIR/metrics.json, table.md, scores.json and figures, and prints the table. Truth is the
    track's shape, or what its scans accumulate to under their true poses.

    Attributes:
        rotate: turn each scan about the sensor: not at all, in yaw, or freely.
        seeds: how many seeds of these turns.
        max_scans: take this many scans of a longer track, evenly.
        as_seeds: the models are training seeds of one method: one row with mean and deviation,
            and a second for the one whose label-free validation cost is lowest.
        track: a second row for each model, which uses all scans of a track together.
        raw: measure the networks' own answers, not refined against the scan.
    """

    data: Data
    out: OutFolder
    model: Models = ()
    baselines: Baselines = ("identity", "local-icp")
    rotate: Literal["none", "yaw", "so3"] = "none"
    seeds: Annotated[int, arg(metavar="N")] = 1
    max_scans: Annotated[int | None, option(metavar="N")] = None
    as_seeds: bool = False
    track: bool = False
    raw: bool = False
    files: Files = DEFAULT_FILES
    device: Device = "auto"
    work: Work = DEFAULT_WORK
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Evaluate and write.

    Raises:
        BadInputError: data, models or settings that cannot be used; nothing with truth.
    """
    import json

    with uncollected():
        from wildshape.baselines.compare import ComparisonOptions, compare
        from wildshape.cli.terminal import TERMINAL, answer, say, say_skipped
        from wildshape.io.progress import counted, duration

    options = ComparisonOptions(
        models=settings.model,
        baselines=settings.baselines,
        rotate=settings.rotate,
        seeds=settings.seeds,
        max_scans=settings.max_scans,
        as_seeds=settings.as_seeds,
        track=settings.track,
        raw=settings.raw,
        coordinates=settings.files.coordinates,
        device=settings.device,
        workers=settings.work.workers,
        ray=settings.work.ray,
        overwrite=settings.overwrite,
    )
    began = time.monotonic()
    found = compare(settings.data, settings.out, options, TERMINAL)
    say_skipped(found.skipped)
    took = duration(time.monotonic() - began)
    say(f"measured in {took} with {counted(found.workers, 'worker')}; see {settings.out}")
    metrics = json.loads((settings.out / "metrics.json").read_text("utf-8"))
    answer(found.table, {**metrics, "workers": found.workers}, as_json=settings.json)
