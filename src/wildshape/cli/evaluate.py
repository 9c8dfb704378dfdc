# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape evaluate`: models and baselines beside each other, by METHOD 8."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import arg

from wildshape.cli.options import AsJson, Data, Device, OutFolder, Overwrite, Refine, Unit
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from wildshape.baselines.dpc import Dpc
    from wildshape.cli.reading import Reading
    from wildshape.evaluation.method import Method
    from wildshape.evaluation.results import Results
    from wildshape.inference.predictor import Predictor

EXAMPLE = "wildshape evaluate test.store --out evaluation --rotate yaw --model runs/cars"
FILES = ("metrics.json", "scores.json", "table.md", "errors.png", "confidence.png", "examples.png")
OURS = "wildshape"

Models = Annotated[
    tuple[Path, ...],
    arg(metavar="M", help="checkpoints or folders of runs; else the shipped weights"),
]
# As in baselines/named.py, which is not read for a mere `--help`; a test holds them together.
BASELINES = "identity, one-scan, local-icp, global-icp, multi-start-icp, gicp, kiss-matcher"
Baselines = Annotated[str, arg(metavar="NAMES", help=f"of {BASELINES}; or none")]


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
    baselines: Baselines = "identity,local-icp"
    rotate: Literal["none", "yaw", "so3"] = "none"
    seeds: Annotated[int, arg(metavar="N")] = 1
    max_scans: Annotated[int | None, arg(metavar="N")] = None
    as_seeds: bool = False
    track: bool = False
    refine: Refine = "joint"
    raw: bool = False
    unit: Unit = "m"
    device: Device = "auto"
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Evaluate and write.

    Raises:
        BadInputError: data, models or settings that cannot be used; nothing with truth.
    """
    from wildshape.cli.output import begin, keep_apart
    from wildshape.cli.reading import Reading
    from wildshape.cli.results import check_refine
    from wildshape.cli.terminal import answer, say_skipped

    if settings.seeds < 1:
        raise BadInputError(f"--seeds {settings.seeds}: expected 1 or more.")
    if settings.max_scans is not None and settings.max_scans < 1:
        raise BadInputError(f"--max-scans {settings.max_scans}: expected 1 or more.")
    check_refine(settings.refine, track=settings.track)
    baselines = choose_baselines(settings.baselines)
    reading = Reading(settings.data, settings.unit)
    _check_truth(reading)
    models = load_models(settings.model, settings.device, raw=settings.raw)
    keep_apart(settings.data, settings.out)
    output = begin(
        settings.out, "evaluate", _identity(settings), FILES, overwrite=settings.overwrite
    )
    pooled = settings.as_seeds and len(models) > 1
    together = settings.refine if settings.track else None
    evaluated = (
        _pooled(models, together) if pooled else [_rows(models, together)] * _useful_seeds(settings)
    )
    runs = [
        evaluate_once(reading, {**baselines, **rows}, settings.rotate, seed, settings.max_scans)
        for seed, rows in enumerate(evaluated)
    ]
    if pooled:
        runs = _with_selected(runs, models)
    made = {**output.record["provenance"], "settings": output.record["settings"]}
    drawn = next(iter(evaluated[0].items()))
    table = write(settings.out, reading, runs, drawn, made, settings.max_scans)
    output.finish(skipped=reading.skipped)
    say_skipped(reading.skipped)
    answer(table, _json(settings.out), as_json=settings.json)


def choose_baselines(names: str) -> "dict[str, Method]":
    """The baselines named, with commas between them; `none` is none.

    Raises:
        BadInputError: one that there is not.
        MissingExtraError: one that needs a library that is not installed.
    """
    from wildshape.baselines.named import baseline

    wanted = [name.strip() for name in names.split(",")]
    return {name: baseline(name) for name in wanted if name not in ("", "none")}


def load_models(
    models: "Sequence[Path]", device: str, *, raw: bool = False
) -> "dict[str, Predictor | Dpc]":
    """Models by the name of their row, ours or DPC's; the shipped weights if none is named.

    Raises:
        BadInputError: a checkpoint that cannot be used, two of one name, or a baseline's name.
    """
    from wildshape.baselines.named import NAMES
    from wildshape.cli.models import load_model, model_file
    from wildshape.training.loop import MODEL

    if not models:
        return {OURS: load_model(None, device, raw=raw)}
    found: dict[str, Predictor | Dpc] = {}
    for model in models:
        file = model_file(model)
        name = file.resolve().parent.name if file.name == MODEL else file.stem
        if name in found:
            raise BadInputError(f"{model}: another --model is called {name} too; rename one.")
        if name in NAMES:
            raise BadInputError(f"{model}: {name} is the name of a baseline; rename the model.")
        found[name] = _dpc(file, device) or load_model(model, device, raw=raw)
    return found


def _dpc(file: Path, device: str) -> "Dpc | None":
    """The trained DPC in a file, if it is one."""
    from wildshape.baselines import dpc
    from wildshape.cli.models import choose_device
    from wildshape.models.dpc_checkpoint import is_dpc

    return dpc.load(file, choose_device(device)) if is_dpc(file) else None


def evaluate_once(
    reading: "Reading",
    methods: "dict[str, Method]",
    rotate: Literal["none", "yaw", "so3"],
    seed: int,
    max_scans: int | None,
) -> "Results":
    """The protocol under one seed, with progress."""
    from wildshape.cli.terminal import progress
    from wildshape.evaluation.protocol import run as run_protocol

    with progress(f"evaluating, seed {seed}", len(reading.source)) as bar:
        tracks = (track for _, track in reading.tracks())
        return run_protocol(methods, tracks, rotate, seed, bar.at, max_scans=max_scans)


def write(
    out: Path,
    reading: "Reading",
    runs: "list[Results]",
    drawn: "tuple[str, Method]",
    made: dict[str, Any],
    max_scans: int | None,
) -> str:
    """Write metrics, scores, table and figures; returns the table.

    Args:
        out: folder.
        reading: the tracks of the runs.
        runs: one a seed.
        drawn: row and method whose best, median and worst object are drawn.
        made: how the figures came about.
        max_scans: as in the runs.
    """
    from wildshape.evaluation.examples import gather
    from wildshape.evaluation.figures import write_figures
    from wildshape.evaluation.results import write_metrics, write_scores
    from wildshape.evaluation.tables import markdown, write_table

    tracks = (track for _, track in reading.tracks())
    write_figures(out, runs[0], gather(tracks, runs[0], *drawn, max_scans=max_scans))
    write_scores(out, runs)
    write_table(out, runs, views=_views(reading))
    write_metrics(out, runs, made)
    return markdown(runs)


def _useful_seeds(settings: Settings) -> int:
    from wildshape.cli.terminal import say

    if settings.rotate == "none" and settings.seeds > 1:
        say("--rotate none leaves nothing to chance: one seed is enough")
        return 1
    return settings.seeds


def _rows(models: "dict[str, Predictor | Dpc]", together: Refine | None) -> "dict[str, Method]":
    """A row a model; where asked, one more for whole tracks used together."""
    from wildshape.baselines.dpc import Dpc
    from wildshape.inference.method import Learned, LearnedTrack

    rows: dict[str, Method] = {}
    for name, model in models.items():
        rows[name] = model if isinstance(model, Dpc) else Learned(model)
        if together and not isinstance(model, Dpc):
            rows[f"{name}, track"] = LearnedTrack(model, together)
    return rows


def _pooled(
    models: "dict[str, Predictor | Dpc]", together: Refine | None
) -> "list[dict[str, Method]]":
    """Each model under our one name, in a run of its own.

    Raises:
        BadInputError: one of them is not ours.
    """
    from wildshape.baselines.dpc import Dpc

    for name, model in models.items():
        if isinstance(model, Dpc):
            raise BadInputError(f"--as-seeds: {name} is a trained DPC; leave out --as-seeds.")
    return [_rows({OURS: model}, together) for model in models.values()]


def _with_selected(runs: "list[Results]", models: "dict[str, Predictor | Dpc]") -> "list[Results]":
    """The run of the model with the lowest label-free cost gets a second row for it."""
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


def _views(reading: "Reading") -> bool:
    first = next((track for _, track in reading.tracks()), None)
    return first is not None and first.sensor.kind == "camera"


def _identity(settings: Settings) -> dict[str, Any]:
    from wildshape.cli.models import fingerprint

    names = ("baselines", "rotate", "seeds", "max_scans", "as_seeds", "track", "unit", "raw")
    names += ("refine",) if settings.refine != "joint" else ()
    models = [fingerprint(model) for model in settings.model] or [fingerprint(None)]
    chosen = {name: getattr(settings, name) for name in names}
    return {**chosen, "data": str(settings.data.resolve()), "models": models}


def _json(out: Path) -> dict[str, Any]:
    import json

    return json.loads((out / "metrics.json").read_text("utf-8"))
