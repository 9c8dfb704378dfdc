# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The parts of the data that probabilities are fitted to, each completed once and kept as a file.

Streets have vehicles and other things; tracks are of vehicles that are partly hidden, completed
with rays and without.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from experiments.trust_data import Both, Known, of_street, of_tracks

from wildshape.errors import BadInputError
from wildshape.inference.predictor import Predictor, load
from wildshape.io.atomic import atomic_write
from wildshape.io.inputs import open_tracks
from wildshape.method.checkpoint import fingerprint
from wildshape.method.trust import ScanFeatures, TrackFeatures
from wildshape.parallel.team import team
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.generate import simulate_tracks
from wildshape.simulate.street.drive_folder import write_drive
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

STREETS = (5, 6, 7, 8, 9, 10, 11, 12)
_STREET = StreetConfig(scans=60)
_BEHIND = SimulationConfig(scans=6, occlusion=0.6, rays=2048)
_TRACKS = {
    "hdl64": replace(_BEHIND, tracks=60, varied=True),
    "hdl32": replace(_BEHIND, tracks=30, varied=True, sensor="hdl32"),
    "os1-128": replace(_BEHIND, tracks=25, varied=True, sensor="os1-128"),
}
_SEED = 7301


@dataclass(frozen=True)
class Parts:
    """What is completed by which weights.

    Attributes:
        out: folder of the parts; what is there is used again.
        model: checkpoint.
        streets: seeds of the simulated streets.
        share: of the simulated tracks.
    """

    out: Path
    model: Path
    streets: tuple[int, ...] = STREETS
    share: float = 1.0

    @property
    def made_by(self) -> str:
        """Of the weights, and of how much is simulated: what is kept serves no others."""
        return f"{fingerprint(self.model)}, share {self.share:g}"

    @property
    def names(self) -> list[str]:
        """Of all simulated parts."""
        return [*(f"street{seed}" for seed in self.streets), *_TRACKS]

    def simulated(self, workers: int = 1) -> dict[str, Both]:
        """All simulated parts by name, so many at once."""
        names = self.names
        with team(workers) as helpers:
            made = helpers.in_order(partial(_made, self), names)
            return {name: self._read(path) for name, path in zip(names, made, strict=True)}

    def street(self, seed: int) -> Both:
        """Another one."""
        return self._read(_made(self, f"street{seed}"))

    def real(self, path: Path) -> Both:
        """Labelled tracks, without rays."""
        source = open_tracks(path)
        tracks = [source[i] for i in range(len(source)) if source[i].label_size_m]
        return self._read(self.kept(path.name, lambda model: of_tracks(model, tracks, rays=False)))

    def kept(self, name: str, make: Callable[[Predictor], Both]) -> Path:
        """The file of a part that was completed before, or is now."""
        path = self.out / f"{name}.npz"
        if not path.is_file():
            made = make(load(self.model))
            columns = {
                f"{part}_{name}": values
                for part, known in made._asdict().items()
                for name, values in known._asdict().items()
            }
            with atomic_write(path) as file:
                np.savez(file, made_by=self.made_by, **columns)
            print(f"{path.stem}: {len(made.scan.pose)} scans", flush=True)
        return path

    def _read(self, path: Path) -> Both:
        with np.load(path) as found:
            if "made_by" not in found or str(found["made_by"]) != self.made_by:
                raise BadInputError(
                    f"{path}: was completed by other weights or with another --share; give another"
                    " --out."
                )
            both = Both(*(Known(*(found[f"{p}_{n}"] for n in Known._fields)) for p in Both._fields))
        wide = [known.features.shape[1] for known in both]
        if wide != [len(ScanFeatures._fields), *[len(TrackFeatures._fields)] * 2]:
            raise BadInputError(f"{path}: was completed with other features; give another --out.")
        return both


def _made(parts: Parts, name: str) -> Path:
    torch.set_num_threads(1)
    of_part = _behind if name in _TRACKS else _street
    return parts.kept(name, partial(of_part, parts, name))


def _street(parts: Parts, name: str, predictor: Predictor) -> Both:
    seed = int(name.removeprefix("street"))
    drive, cuts = parts.out / name, parts.out / f"clusters{seed}"
    write_drive(WholeDrive(_STREET, seed), drive)
    cuts.mkdir(exist_ok=True)
    return of_street(predictor, drive, cuts, seed)


def _behind(parts: Parts, name: str, predictor: Predictor) -> Both:
    config, seed = _TRACKS[name], _SEED + list(_TRACKS).index(name)
    config = replace(config, tracks=max(round(parts.share * config.tracks), 4))
    tracks = list(simulate_tracks(config, seed, workers=1))
    found = [of_tracks(predictor, tracks, rays) for rays in (False, True)]
    return Both(*map(Known.joined, zip(*found)))
