# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Models and baselines measured beside each other on one data set, and written (METHOD 8)."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from wildshape.arguments import as_path, check_fields, expect
from wildshape.baselines.dpc import completer as dpc
from wildshape.baselines.dpc.checkpoint import is_dpc
from wildshape.baselines.dpc.completer import Dpc
from wildshape.baselines.named import NAMES, baseline
from wildshape.datasets.tracks.truth import misplaced
from wildshape.errors import BadInputError
from wildshape.evaluation.evaluate import evaluate_once, write_evaluation
from wildshape.evaluation.method import Method
from wildshape.evaluation.results import Results, Rotate
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import Predictor, load
from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.output import begin, keep_apart
from wildshape.io.progress import SILENT, Progress, counted
from wildshape.io.scans.points import SENSOR_METRES, Coordinates
from wildshape.io.store.store import is_store, open_store
from wildshape.method.checkpoint import MODEL, fingerprint, weights_file
from wildshape.ops.device import choose_device
from wildshape.parallel.team import team
from wildshape.records import Track

OURS = "wildshape"
"""The name of our row, where it has no other."""

FILES = ("metrics.json", "scores.json", "table.md", "errors.png", "confidence.png", "examples.png")
Model = Predictor | Dpc
_POSES_CURE = (
    "poses.txt holds T_sensor_object, shape.ply is in the object's frame and of the scans' unit,"
    " label_size_m is length, width, height in metres"
)


@dataclass(frozen=True)
class ComparisonOptions:
    """What is measured, and how.

    Attributes:
        models: checkpoints, run folders or names of shipped weights; the shipped ones if none.
        baselines: of `named.NAMES`; `none` is none.
        rotate: turn each scan about the sensor: not at all, in yaw, or freely.
        seeds: how many seeds of these turns.
        max_scans: take this many scans of a longer track, evenly.
        as_seeds: the models are training seeds of one method: one row with mean and deviation, and
            a second for the one whose label-free validation cost is lowest.
        track: a second row for each model, which uses all scans of a track together.
        raw: measure the networks' own answers, not refined against the scan.
        coordinates: of the data's files.
        device: `auto`, `cpu` or `cuda`.
        workers: processes; None: one a core.
        ray: address of a Ray cluster in place of this machine, if any.
        overwrite: replace an earlier output.
    """

    models: tuple[Path, ...] = ()
    baselines: tuple[str, ...] = ("identity", "local-icp")
    rotate: Rotate = "none"
    seeds: int = 1
    max_scans: int | None = None
    as_seeds: bool = False
    track: bool = False
    raw: bool = False
    coordinates: Coordinates = SENSOR_METRES
    device: str = "auto"
    workers: int | None = None
    ray: str | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self)
        if self.seeds < 1:
            raise BadInputError(f"--seeds {self.seeds}: expected 1 or more.")
        if self.max_scans is not None and self.max_scans < 1:
            raise BadInputError(f"--max-scans {self.max_scans}: expected 1 or more.")
        if self.as_seeds and len(self.models) < 2:
            raise BadInputError("--as-seeds: name two models or more by --model.")

    def identity(self, data: Path) -> dict[str, Any]:
        """What decides the figures, as JSON values."""
        names = ("rotate", "seeds", "max_scans", "as_seeds", "track", "raw")
        return {
            **{name: getattr(self, name) for name in names},
            **asdict(self.coordinates),
            "baselines": ",".join(self.baselines),
            "data": str(data.resolve()),
            "files": fingerprint_of(data),
            "models": [fingerprint(model) for model in self.models or (None,)],
        }


_DEFAULT = ComparisonOptions()


class Comparison(NamedTuple):
    """What came of it.

    Attributes:
        table: in Markdown.
        skipped: what could not be used, with the reason.
        workers: how many did the work.
    """

    table: str
    skipped: tuple[tuple[str, str], ...]
    workers: int


def compare(
    data: Path | str,
    out: Path | str,
    options: ComparisonOptions = _DEFAULT,
    progress: Progress = SILENT,
) -> Comparison:
    """Measure shapes and registration against truth, and write metrics, scores, table, figures.

    Raises:
        BadInputError: data, models or options that cannot be used; nothing with truth.
        MissingExtraError: a baseline needs a library that is not installed.
    """
    data, out = as_path(data, "data"), as_path(out, "out")
    expect(options, ComparisonOptions, "options")
    baselines = {name: baseline(name) for name in options.baselines if name != "none"}
    source = open_tracks(data, options.coordinates)
    first = _first_with_poses(source)
    if told := misplaced(first):  # at once: what follows may take hours
        progress.say(f"{first.name}: {told}; {_POSES_CURE}")
    models = load_models(options.models, options.device, raw=options.raw)
    for told in _other_sensors(source, models):
        progress.say(told)
    keep_apart(out, data, *map(weights_file, options.models))
    pooled = options.as_seeds and len(models) > 1
    for told in _unlike_trainings(models) if pooled else ():
        progress.say(told)
    if pooled and options.seeds > 1:
        progress.say("--as-seeds: each model is measured once, under a seed of its own for turns")
    evaluated = (
        _pooled(models, track=options.track)
        if pooled
        else [_rows(models, track=options.track)] * _useful_seeds(options, progress)
    )
    identity = options.identity(data)
    output = begin(out, "evaluate", identity, FILES, overwrite=options.overwrite, progress=progress)
    with output.abandoned_if_refused(), team(options.workers, options.ray) as helpers:
        measure = partial(evaluate_once, progress=progress, helpers=helpers)
        odd: dict[str, str] = {}
        runs = [
            measure(
                source,
                {**baselines, **rows},
                options.rotate,
                seed,
                options.max_scans,
                odd=None if seed else odd,
            )
            for seed, rows in enumerate(evaluated)
        ]
        workers = helpers.worked
    if others := [(name, told) for name, told in odd.items() if name != first.name]:
        name, told = others[0]
        more = f" ({counted(len(others) - 1, 'more track')} likewise)" if others[1:] else ""
        progress.say(f"{name}: {told}{more}; {_POSES_CURE}")
    for told in (*source.doubts, *_of_two_kinds(source), *_seen_in_training(data, models)):
        progress.say(told)
    if pooled:
        runs = _with_selected(runs, models)
    provenance = {**output.record["provenance"], "settings": output.record["settings"]}
    drawn = next(iter(evaluated[0].items()))
    table = write_evaluation(out, source, runs, drawn, provenance)
    output.finish(skipped=source.skipped)
    return Comparison(table, source.skipped, workers)


def load_models(models: Sequence[Path], device: str, *, raw: bool = False) -> dict[str, Model]:
    """Models by the name of their row, ours or DPC's; the shipped weights if none is named.

    Raises:
        BadInputError: a checkpoint that cannot be used, two of one name, or a baseline's name.
    """
    if not models:
        return {OURS: load(None, device, raw=raw)}
    found: dict[str, Model] = {}
    for model in models:
        file = weights_file(model)
        name = file.resolve().parent.name if file.name == MODEL else file.stem
        if name in found:
            raise BadInputError(f"{model}: another --model is called {name} too; rename one.")
        if name in NAMES:
            raise BadInputError(f"{model}: {name} is the name of a baseline; rename the model.")
        ours = not is_dpc(file)
        found[name] = load(file, device, raw=raw) if ours else dpc.load(file, choose_device(device))
    return found


def _useful_seeds(options: ComparisonOptions, progress: Progress) -> int:
    if options.rotate == "none" and options.seeds > 1:
        progress.say("--rotate none leaves nothing to chance: one seed is enough")
        return 1
    return options.seeds


def _rows(models: Mapping[str, Model], *, track: bool) -> dict[str, Method]:
    """A row a model; where asked, one more for whole tracks used together."""
    rows: dict[str, Method] = {}
    for name, model in models.items():
        rows[name] = model if isinstance(model, Dpc) else Learned(model)
        if track and not isinstance(model, Dpc):
            rows[f"{name}, track"] = Learned(model, track=True)
    return rows


def _pooled(models: Mapping[str, Model], *, track: bool) -> list[dict[str, Method]]:
    """Each model under our one name, in a run of its own.

    Raises:
        BadInputError: one of them is not ours.
    """
    for name, model in models.items():
        if isinstance(model, Dpc):
            raise BadInputError(f"--as-seeds: {name} is a trained DPC; leave out --as-seeds.")
    return [_rows({OURS: model}, track=track) for model in models.values()]


def _with_selected(runs: list[Results], models: Mapping[str, Model]) -> list[Results]:
    """The run of the model with the lowest label-free cost gets a second row for it."""
    costs = [model.settings.cost_m[0] for model in models.values() if isinstance(model, Predictor)]
    best = costs.index(min(costs))
    name = f"{OURS}, seed selected without labels ({list(models)[best]})"
    chosen = replace(runs[best][OURS], name=name)
    return [
        replace(run, methods=(*run.methods, chosen)) if i == best else run
        for i, run in enumerate(runs)
    ]


def _unlike_trainings(models: Mapping[str, Model]) -> list[str]:
    """A sentence where models were trained otherwise than as seeds of one method."""
    known = {
        name: model.settings.provenance["identity"]
        for name, model in models.items()
        if "identity" in model.settings.provenance
    }
    others = {
        what: name
        for what in ("settings", "data")
        for name, made in known.items()
        if made.get(what) != next(iter(known.values())).get(what)
    }
    return [
        f"--as-seeds: {name} was trained with other {what} than {next(iter(known))}; mean and"
        " deviation are not of seeds alone, and costs may not be comparable"
        for what, name in others.items()
    ]


def _of_two_kinds(source: TrackSource) -> list[str]:
    """A sentence where scans of LiDARs and of cameras went into the same figures."""
    kinds = source.sensor_kinds
    if len(kinds) < 2:
        return []
    return [
        f"{source.path}: holds {' and '.join(kinds)} scans, and each figure is of both together;"
        " evaluate those of one kind at a time"
    ]


def _other_sensors(source: TrackSource, models: Mapping[str, Model]) -> list[str]:
    """A sentence on each of our models that learned from another sensor's scans than the first."""
    kind = next(iter(source)).sensor.kind
    return [
        f"{name}: trained on {model.settings.sensor} scans, but these are {kind} scans; choose"
        " other weights by --model"
        for name, model in models.items()
        if isinstance(model, Predictor) and model.settings.sensor != kind
    ]


def _seen_in_training(data: Path, models: Mapping[str, Model]) -> list[str]:
    """A sentence on each model that was trained on what it is measured on."""
    packed = open_store(data).fingerprint if is_store(data) else None
    made = {name: model.settings.provenance for name, model in models.items()}
    return [
        f"{name}: was trained on {data}; these figures say little of objects that it never saw"
        for name, of in made.items()
        if packed == of.get("identity", {}).get("data", "")
        or ("data" in of and _are_one(data.resolve(), Path(of["data"]).resolve()))
    ]


def _are_one(data: Path, other: Path) -> bool:
    """Whether two places are one, or one is a store that was made of all of the other."""
    return data == other or data == _root_of(other) or other == _root_of(data)


def _root_of(path: Path) -> Path | None:
    """What a packed store was converted from, if it is there and says so."""
    with suppress(BadInputError, KeyError, TypeError):
        return Path(open_store(path).provenance["settings"]["root"])
    return None


def _first_with_poses(source: TrackSource) -> Track:
    for track in source:
        if track.T_sensor_object is not None:
            return track
    raise BadInputError(
        f"{source.path}: no track has true poses (poses.txt) to measure against;"
        " complete it instead."
    )
