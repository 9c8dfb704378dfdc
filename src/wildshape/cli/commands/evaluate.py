# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape evaluate`: models and baselines beside each other, by METHOD 8."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from wildshape.baselines.named import NAMES
from wildshape.cli.options import (
    AT_ORIGIN,
    AsJson,
    Data,
    Device,
    Origin,
    OutFolder,
    Overwrite,
    Unit,
    listed,
    option,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.baselines.dpc.completer import Dpc
    from wildshape.cli.input.tracks import Reading
    from wildshape.evaluation.method import Method
    from wildshape.evaluation.results import Results
    from wildshape.inference.predictor import Predictor

EXAMPLES = (
    "wildshape evaluate test.store --out evaluation",
    "wildshape evaluate test.store --out evaluation --rotate yaw --model runs/cars --track",
    "wildshape evaluate test.store --out seeds --model run0,run1,run2 --as-seeds --baselines none",
)
FILES = ("metrics.json", "scores.json", "table.md", "errors.png", "confidence.png", "examples.png")

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
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
    device: Device = "auto"
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Evaluate and write.

    Raises:
        BadInputError: data, models or settings that cannot be used; nothing with truth.
    """
    from wildshape.cli.evaluation import choose_baselines, evaluate_once, write
    from wildshape.cli.input.tracks import Reading
    from wildshape.cli.models import load_models
    from wildshape.cli.output import begin, keep_apart
    from wildshape.cli.terminal import answer, say_skipped
    from wildshape.io.scans.points import Coordinates

    if settings.seeds < 1:
        raise BadInputError(f"--seeds {settings.seeds}: expected 1 or more.")
    if settings.max_scans is not None and settings.max_scans < 1:
        raise BadInputError(f"--max-scans {settings.max_scans}: expected 1 or more.")
    baselines = choose_baselines(settings.baselines)
    reading = Reading(settings.data, Coordinates(settings.unit, settings.origin))
    _check_truth(reading)
    models = load_models(settings.model, settings.device, raw=settings.raw)
    keep_apart(settings.data, settings.out)
    output = begin(
        settings.out, "evaluate", _identity(settings), FILES, overwrite=settings.overwrite
    )
    pooled = settings.as_seeds and len(models) > 1
    track = settings.track
    evaluated = (
        _pooled(models, track=track)
        if pooled
        else [_rows(models, track=track)] * _useful_seeds(settings)
    )
    runs = [
        evaluate_once(reading, {**baselines, **rows}, settings.rotate, seed, settings.max_scans)
        for seed, rows in enumerate(evaluated)
    ]
    if pooled:
        runs = _with_selected(runs, models)
    made = {**output.record["provenance"], "settings": output.record["settings"]}
    drawn = next(iter(evaluated[0].items()))
    table = write(settings.out, reading, runs, drawn, made)
    output.finish(skipped=reading.skipped)
    say_skipped(reading.skipped)
    answer(table, _json(settings.out), as_json=settings.json)


def _useful_seeds(settings: Settings) -> int:
    from wildshape.cli.terminal import say

    if settings.rotate == "none" and settings.seeds > 1:
        say("--rotate none leaves nothing to chance: one seed is enough")
        return 1
    return settings.seeds


def _rows(models: "dict[str, Predictor | Dpc]", *, track: bool) -> "dict[str, Method]":
    """A row a model; where asked, one more for whole tracks used together."""
    from wildshape.baselines.dpc.completer import Dpc
    from wildshape.inference.evaluated import Learned, LearnedTrack

    rows: dict[str, Method] = {}
    for name, model in models.items():
        rows[name] = model if isinstance(model, Dpc) else Learned(model)
        if track and not isinstance(model, Dpc):
            rows[f"{name}, track"] = LearnedTrack(model)
    return rows


def _pooled(models: "dict[str, Predictor | Dpc]", *, track: bool) -> "list[dict[str, Method]]":
    """Each model under our one name, in a run of its own.

    Raises:
        BadInputError: one of them is not ours.
    """
    from wildshape.baselines.dpc.completer import Dpc
    from wildshape.cli.models import OURS

    for name, model in models.items():
        if isinstance(model, Dpc):
            raise BadInputError(f"--as-seeds: {name} is a trained DPC; leave out --as-seeds.")
    return [_rows({OURS: model}, track=track) for model in models.values()]


def _with_selected(runs: "list[Results]", models: "dict[str, Predictor | Dpc]") -> "list[Results]":
    """The run of the model with the lowest label-free cost gets a second row for it."""
    from wildshape.cli.models import OURS
    from wildshape.inference.predictor import Predictor

    costs = [model.settings.cost_m[0] for model in models.values() if isinstance(model, Predictor)]
    best = costs.index(min(costs))
    name = f"{OURS}, seed selected without labels ({list(models)[best]})"
    chosen = replace(runs[best][OURS], name=name)
    return [
        replace(run, methods=(*run.methods, chosen)) if i == best else run
        for i, run in enumerate(runs)
    ]


def _check_truth(reading: "Reading") -> None:
    if all(track.T_sensor_object is None for _, track in reading.tracks()):
        raise BadInputError(
            f"{reading.source.path}: no track has true poses (poses.txt) to measure against;"
            " complete it instead."
        )


def _identity(settings: Settings) -> dict[str, Any]:
    from wildshape.cli.models import fingerprint

    names = (
        "baselines",
        "rotate",
        "seeds",
        "max_scans",
        "as_seeds",
        "track",
        "unit",
        "origin",
        "raw",
    )
    models = [fingerprint(model) for model in settings.model] or [fingerprint(None)]
    chosen = {name: getattr(settings, name) for name in names}
    chosen["baselines"] = ",".join(settings.baselines)
    return {**chosen, "data": str(settings.data.resolve()), "models": models}


def _json(out: Path) -> dict[str, Any]:
    import json

    return json.loads((out / "metrics.json").read_text("utf-8"))
