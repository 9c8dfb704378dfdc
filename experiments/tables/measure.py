# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rows measured by the protocol of METHOD 8: once a seed, found again when finished."""

import json
from dataclasses import asdict, dataclass, replace
from typing import Any

from experiments.tables.data import key, store_of
from experiments.tables.table import Baseline, Block, Row, Shipped, Trained
from experiments.tables.train import Model, Workshop, model_of

from wildshape.baselines.dpc import completer as dpc
from wildshape.baselines.dpc.checkpoint import is_dpc
from wildshape.baselines.dpc.pre_aligned import pre_aligned
from wildshape.baselines.named import baseline
from wildshape.cli.terminal import TERMINAL, say
from wildshape.errors import MissingExtraError
from wildshape.evaluation.evaluate import evaluate_once
from wildshape.evaluation.method import Method
from wildshape.evaluation.metrics import BoxScore, CompletionError, RegistrationScore
from wildshape.evaluation.results import (
    CompletionScore,
    Limits,
    MethodScores,
    Results,
    Rotate,
    Skipped,
)
from wildshape.inference.evaluation_adapter import CanonicalShapes, Learned
from wildshape.inference.predictor import load
from wildshape.io.atomic import write_json
from wildshape.io.inputs import TrackSource, open_tracks
from wildshape.io.output import provenance
from wildshape.io.store.store import open_store
from wildshape.method.checkpoint import fingerprint
from wildshape.ops.device import choose_device
from wildshape.records import Track
from wildshape.training.setup import split_tracks


@dataclass(frozen=True)
class Measured:
    """One row under one seed.

    Attributes:
        results: of the protocol.
        made: command, commit, hardware, model.
        model: if the row is trained.
    """

    results: Results
    made: dict[str, Any]
    model: Model | None


def measure(
    shop: Workshop, row: Row, block: Block, rotate: Rotate, seed: int, max_scans: int | None
) -> Measured | None:
    """Scores of a row; None where a library that it needs is not installed."""
    test = store_of(shop.folder, block.test)  # first: it may be refused, training takes hours
    model = model_of(shop, row, seed) if isinstance(row, Trained) else None
    mark = _mark(row, model)
    truth = ("accumulated",) if block.accumulated else ()
    name = f"{key(row.name, mark, block.test, rotate, seed, max_scans, *truth)}.json"
    path = shop.folder / "scores" / name
    if not path.is_file():
        method = method_of(shop, row, model)
        if method is None:
            return None
        source = open_tracks(test)
        source = WithoutShapes(source) if block.accumulated else source
        found = evaluate_once(source, {row.name: method}, rotate, seed, max_scans, TERMINAL)
        made = {**provenance(shop.command), "model": mark}
        write_json(path, {"results": asdict(found), "made": made})
    kept = json.loads(path.read_text("utf-8"))
    return Measured(as_results(kept["results"], Limits(max_scans=max_scans)), kept["made"], model)


class WithoutShapes(TrackSource):
    """Tracks whose true shapes are not known: evaluation accumulates their scans."""

    def __init__(self, source: TrackSource) -> None:
        super().__init__(source.path, source.names, source._read)

    def __getitem__(self, index: int) -> Track:
        return replace(super().__getitem__(index), shape=None)


def seeds_of(row: Row, rotate: Rotate, seeds: int) -> range:
    """What is not trained has nothing left to chance on scans as recorded."""
    return range(1) if rotate == "none" and not isinstance(row, Trained) else range(seeds)


def _mark(row: Row, model: Model | None) -> str:
    """Fingerprint of the weights, and how they answer if not alone; nothing for baselines."""
    if isinstance(row, Baseline):
        return ""
    answer = row.answer if isinstance(row, Trained) else "raw"
    print_ = fingerprint(None if model is None else model.path)
    return print_ if answer == "raw" else f"{print_}, {answer}"


def method_of(shop: Workshop, row: Row, model: Model | None) -> Method | None:
    """What is measured; of trained rows the network's own answers, unless the row says more."""
    if model is not None and is_dpc(model.path):
        assert isinstance(row, Trained)
        method = dpc.load(model.path, choose_device(shop.device))
        aligned = row.answer == "canonical"
        return pre_aligned(method, _held_out(shop, row)) if aligned else method
    if isinstance(row, Shipped) or model is not None:
        path = None if model is None else model.path
        answer = row.answer if isinstance(row, Trained) else "refined"
        predictor = load(path, shop.device, raw=answer in ("raw", "canonical"))
        if answer == "canonical":
            return CanonicalShapes(predictor)
        return Learned(predictor, track=answer == "track")
    try:
        return baseline(row.name)
    except MissingExtraError as error:
        say(f"row {row.name} left out: {error}")
        return None


def _held_out(shop: Workshop, row: Trained) -> list[Track]:
    """The tracks of a row's data that it was not trained on."""
    store = open_store(shop.data(row))
    return [store.track(int(index)) for index in split_tracks(len(store))[1]]


def as_results(kept: dict[str, Any], limits: Limits) -> Results:
    """What `asdict` made of results, as they were."""
    methods = tuple(_scores(method) for method in kept["methods"])
    return Results(kept["rotate"], kept["seed"], methods, limits)


def _scores(kept: dict[str, Any]) -> MethodScores:
    return MethodScores(
        name=kept["name"],
        completions=tuple(_completion(row) for row in kept["completions"]),
        registrations=tuple(RegistrationScore(**row) for row in kept["registrations"]),
        skipped=tuple(Skipped(**row) for row in kept["skipped"]),
        about=kept["about"],
    )


def _completion(row: dict[str, Any]) -> CompletionScore:
    partial, box = row["error_partial"], row.get("box")
    errors = {
        "error": CompletionError(**row["error"]),
        "error_partial": None if partial is None else CompletionError(**partial),
        "box": None if box is None else BoxScore(**box),
    }
    return CompletionScore(**{**row, **errors})
