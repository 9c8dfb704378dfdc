# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The folder of a training run: its marker, and the tracks packed into it."""

import json
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.io.atomic import lock_folder, write_json
from wildshape.io.earlier import forget
from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.guard import read_json, reading
from wildshape.io.inputs import open_tracks, refuse_other_coordinates
from wildshape.io.output import MARKER, Output, begin, keep_apart, remove_leftovers
from wildshape.io.progress import SILENT, Progress
from wildshape.io.store.store import Store, is_finished_store, is_store, open_store
from wildshape.io.write_tracks import write_tracks
from wildshape.records import SensorKind
from wildshape.training.options import TrainingOptions
from wildshape.training.recipes import refuse_other_sensor, sensor_kind
from wildshape.training.state import STATE

_PACKED = "data.store"
_FILES_SEEN = "files"  # in the settings of what was packed: which files these were
_SETTINGS = ("preset", "encoder", "steps", "seed")
_FILES = (
    "*.safetensors",
    "run.json",
    "log.jsonl",
    "profile.txt",
    "tensorboard/*",
    f"{_PACKED}/*",
)


@contextmanager
def begun_run(
    data: Path,
    out: Path,
    options: TrainingOptions,
    weights: Sequence[Path] = (),
    only: SensorKind | None = None,
) -> Iterator[None]:
    """The marker of a run; of a new one nothing stays if what is done in here is refused.

    Args:
        data: a packed store, or a DATASET folder.
        out: folder of the run.
        options: how it is trained.
        weights: that are read.
        only: the sensor that the preset is for; None: any.

    Raises:
        BadInputError: another run is there, or something else; or data that cannot be trained on.
    """
    output = _begin(data, out, options, weights, only)
    if output is None:
        yield
        return
    with output.abandoned_if_refused():
        try:
            yield
        except BadInputError:
            shutil.rmtree(out / _PACKED, ignore_errors=True)
            raise
    forget(out)  # an earlier run


def _begin(
    data: Path,
    out: Path,
    options: TrainingOptions,
    weights: Sequence[Path],
    only: SensorKind | None,
) -> Output | None:
    """None where a run is gone on with, and to processes that do not lead."""
    if int(os.environ.get("RANK", "0")) > 0:
        return None
    settings = {"data": str(data), **{name: str(getattr(options, name)) for name in _SETTINGS}}
    begun = _record_of_run(out)
    if begun is not None and options.resume:
        lock_folder(out)
        if not (out / STATE).exists():  # which knows better: one setting has several spellings
            _refuse_other(out, begun["settings"], settings)
            write_json(out / MARKER, {**begun, "settings": settings})
        remove_leftovers(out)
        return None
    keep_apart(out, data, *weights)
    if begun is not None and not options.overwrite:
        raise BadInputError(
            f"{out}: a run is there already; pass --resume to go on with it, --overwrite"
            " to replace it, or choose another --out."
        )
    _refuse_untrainable(data, options, only)  # before an earlier run is gone
    return begin(out, "train", settings, _FILES, overwrite=options.overwrite)


def _refuse_untrainable(data: Path, options: TrainingOptions, only: SensorKind | None) -> None:
    """Look at a store as a whole, of track folders at the first track alone."""
    kind = next(iter(open_tracks(data, options.coordinates))).sensor.kind
    if is_store(data):
        kind = sensor_kind(open_store(data))
    else:
        _refuse_processes(data)
    refuse_other_sensor(data, kind, only, options.preset)


def _refuse_processes(data: Path) -> None:
    """Several processes cannot all pack track folders."""
    if int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise BadInputError(
            f"{data}: several processes need a packed store; make one first by"
            f" `wildshape convert folder {data} OUT`."
        )


def _record_of_run(out: Path) -> dict[str, Any] | None:
    """What the marker holds; None where no training was begun."""
    marker = out / MARKER
    if not marker.is_file():
        return None
    record = read_json(marker, "how a folder was made", dict)
    if record.get("command") != "train":
        return None
    with reading(marker, "how a folder was made"):
        return {**record, "settings": dict(record["settings"])}


def _refuse_other(out: Path, begun: dict[str, Any], settings: dict[str, str]) -> None:
    """Data are compared where they are opened: a store may have been moved."""
    different = [name for name in _SETTINGS if begun.get(name) != settings[name]]
    if different:
        raise BadInputError(
            f"{out}: its run has other {' and '.join(different)}; resume with the same settings, or"
            " choose a new --out."
        )


def open_training_data(
    data: Path, out: Path, options: TrainingOptions, progress: Progress = SILENT
) -> Store:
    """The packed store to train on; track folders are packed once into the run's folder.

    Raises:
        BadInputError: no tracks there, others than the run has; or track folders under torchrun.
    """
    if is_store(data):
        refuse_other_coordinates(data, options.coordinates)
        return open_store(data)
    _refuse_processes(data)
    packed = out / _PACKED
    place = {"input": str(data.resolve()), **asdict(options.coordinates)}
    origin = {**place, _FILES_SEEN: fingerprint_of(data)}
    if options.resume and is_finished_store(packed):  # else it is none, or half-written
        return _packed_before(packed, data, origin)
    source = open_tracks(data, options.coordinates)
    write_tracks(
        source,
        packed,
        "packed",
        command="train",
        settings=origin,
        overwrite=True,
        progress=progress,
        bar=("packing tracks", len(source)),
    )
    for told in source.doubts:
        progress.say(told)
    progress.skipped(source.skipped)
    return open_store(packed, data)


def _packed_before(packed: Path, data: Path, origin: dict[str, Any]) -> Store:
    """The run's own store, if `origin` says that it is of these tracks, as they were then."""
    store = open_store(packed, data)
    then, now = dict(store.provenance.get("settings") or {}), json.loads(json.dumps(origin))
    files = now.pop(_FILES_SEEN)
    packed_files = then.pop(_FILES_SEEN, files)  # older runs did not keep it
    if then != now:
        raise BadInputError(
            f"{data}: the run packed tracks of another place, --unit or --origin; resume with"
            f" those, with {packed} if they only moved, or choose a new --out."
        )
    if packed_files != files:
        raise BadInputError(
            f"{data}: holds other files than the run packed; resume with {packed} to go on with"
            " the tracks as they were, or choose a new --out to train on what is there now."
        )
    return store


def finish_run(out: Path) -> None:
    """Say in the run's folder that it is finished."""
    forget(out)
    marker = out / MARKER
    write_json(marker, {**json.loads(marker.read_text("utf-8")), "status": "finished"})
