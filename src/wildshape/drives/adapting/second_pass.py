# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a second pass writes, and how its results take the place of the first pass's.

Until it is finished the results of the first pass stay. Then they are moved into `first/`, and the
new ones to where they were; a run killed in between is ended before anything else is done. Results
of an earlier second pass are removed: `first/` keeps those of the first one.
"""

import shutil
from dataclasses import asdict
from pathlib import Path

from wildshape.drives.result import REPORT, DriveResult
from wildshape.drives.writing.folder import BOXES, MCAP, MESHES, RRD, SHAPES, TRACKS
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import lock_folder, write_json, write_text
from wildshape.io.guard import read_json
from wildshape.io.output import MARKER
from wildshape.method.checkpoint import fingerprint

FIRST = "first"
_MODEL = "model.txt"
_FINISHED, _SAYS = "finished.json", "what `wildshape drive` says of itself"
_FOUND = (BOXES, TRACKS, "objects", SHAPES)  # the first of them is moved first
_MADE_OF_IT = (MESHES, "boxes", MCAP, RRD, REPORT)


def stages_of(out: Path) -> Path:
    """What the stages of a second pass find."""
    return out / "stages" / "adapted"


def results_of(out: Path) -> Path:
    """Its results until they are put in place."""
    return stages_of(out) / "found"


def first_pass_of(out: Path) -> Path:
    """Where the results of a drive's first pass lie."""
    return out / FIRST if (out / FIRST / BOXES).is_file() else out


def is_done(out: Path, model: str) -> bool:
    """Whether a drive's results are of a second pass with that model."""
    return read_json(out / MARKER, _SAYS).get("adapted") == fingerprint(Path(model))


def begin_second(out: Path, model: str) -> None:
    """Keep of an earlier second pass what the same model found; of another remove all."""
    stages = stages_of(out)
    known, asked = stages / _MODEL, fingerprint(Path(model))
    if not known.is_file() or known.read_text("utf-8") != asked:
        _remove(stages)
    write_text(known, asked)


def conclude(out: Path, found: DriveResult, model: str) -> DriveResult:
    """Say that a second pass is finished, put its results in place, and give back what it found."""
    result = {**asdict(found), "out": str(out)}
    said = {"result": result, "adapted": fingerprint(Path(model))}
    write_json(stages_of(out) / _FINISHED, said)
    put_in_place(out)
    return found


def put_in_place(out: Path) -> None:
    """Put the results of a finished second pass in place, if that is not done yet.

    Raises:
        BadInputError: what it left is damaged.
    """
    said = stages_of(out) / _FINISHED
    if not said.is_file():
        return
    lock_folder(out)
    found, first, marker = results_of(out), out / FIRST, out / MARKER
    record = read_json(marker, _SAYS)  # says whose results are there until the new ones are
    if (found / BOXES).is_file():  # nothing was put in place yet
        first.mkdir(exist_ok=True)
        for name in (*_FOUND, *_MADE_OF_IT):
            if "adapted" in record:
                _remove(out / name)
            else:
                _move(out / name, first / name)
    for name in _FOUND:
        _move(found / name, out / name)
    write_json(marker, {**record, **read_json(said, "what a second pass found")})
    said.unlink()


def _move(path: Path, target: Path) -> None:
    if path.exists():
        path.rename(target)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def like(first: Predictor, model: Path) -> Predictor:
    """Another model used as the first one is.

    Raises:
        BadInputError: the checkpoint cannot be used.
    """
    level, raw = first.up is not None, not first.refines
    return load(model, str(first.device), raw=raw, level=level, config=first.config)
