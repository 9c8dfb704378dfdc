# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The data of a table as values; made once, as packed stores, and found again."""

import csv
import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from wildshape.cli.terminal import TERMINAL, say
from wildshape.datasets.sources import open_source
from wildshape.datasets.tracks.source import all_tracks
from wildshape.errors import BadInputError
from wildshape.io.store.store import is_finished_store
from wildshape.io.write_tracks import write_tracks
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

Split = Literal["train", "test"]
_COLUMNS = ("category", "file", "split")


@dataclass(frozen=True)
class Cad:
    """Meshes of a folder with `manifest.csv` (columns category, file, split)."""

    folder: Path
    categories: tuple[str, ...]
    split: Split


@dataclass(frozen=True)
class Simulated:
    """Simulated tracks, of CAD meshes or of our procedural shapes."""

    name: str
    config: SimulationConfig
    seed: int
    cad: Cad | None = None


@dataclass(frozen=True)
class Kitti:
    """Labelled cars of KITTI raw, as `wildshape convert kitti-raw` reads them."""

    name: str
    root: Path
    every: int = 2


Data = Simulated | Kitti


def key(*parts: object) -> str:
    """A short name for values, the same wherever they are equal."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:10]


def store_of(folder: Path, data: Data) -> Path:
    """The packed store of the data below `folder`, made if it is not there whole.

    Raises:
        BadInputError: no such meshes or drives.
    """
    path = folder / "data" / f"{data.name}-{key(data)}"
    if is_finished_store(path):
        return path
    tracks, count = _tracks(folder, data)
    settings = cast("dict[str, Any]", as_values(data))
    bar = (f"making {data.name}", count)
    write_tracks(
        tracks, path, "packed", command="tables", settings=settings, progress=TERMINAL, bar=bar
    )
    return path


def as_values(record: Any) -> Any:
    """A frozen record as JSON values."""
    return json.loads(json.dumps(asdict(record), default=str))


def _tracks(folder: Path, data: Data) -> tuple[Iterable[Track], int]:
    if isinstance(data, Kitti):
        return all_tracks(open_source("kitti-raw", data.root, {"every": data.every})), 0
    config = data.config
    if data.cad is not None:
        from dataclasses import replace

        config = replace(config, meshes=_meshes(folder, data.cad))
    return simulate_tracks(config, data.seed), config.tracks


def _meshes(folder: Path, cad: Cad) -> Path:
    """A folder of links to the meshes, in a seeded order: tracks take them one after the other."""
    into = folder / "meshes" / key(cad)
    manifest = cad.folder / "manifest.csv"
    if not manifest.is_file():
        raise BadInputError(f"{manifest}: no such file; --cad names a folder with a manifest.csv.")
    with manifest.open(encoding="utf-8-sig") as file:
        table = csv.DictReader(file)
        if lacks := [name for name in _COLUMNS if name not in (table.fieldnames or ())]:
            raise BadInputError(f"{manifest}: has no column {', '.join(lacks)}; add it.")
        rows = [row for row in table if row["split"] == cad.split]
    files = [cad.folder / row["file"] for row in rows if row["category"] in cad.categories]
    if not files:
        wanted = f"{' or '.join(cad.categories)}, split {cad.split}"
        raise BadInputError(f"{manifest}: lists no mesh of {wanted}; add some.")
    if lost := [mesh for mesh in files if not mesh.is_file()]:
        raise BadInputError(f"{manifest}: lists {lost[0]}, which is not there; copy it again.")
    into.mkdir(parents=True, exist_ok=True)
    for place, mesh in zip(np.random.default_rng(0).permutation(len(files)), files):
        link = into / f"{place:04d}_{mesh.name}"
        if not link.is_symlink():
            link.symlink_to(mesh.resolve())
    say(f"{len(files)} meshes of {', '.join(cad.categories)}, split {cad.split}")
    return into
