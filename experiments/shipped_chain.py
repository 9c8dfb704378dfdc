# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Make weights of all the names that the package ships, by one command.

    python -m experiments.shipped_chain --cad CAD --out RUN

CAD holds `manifest.csv` (columns category, file, split, tier, licence, source, name) and the meshes
it names. Simulated scans alone are trained on, of procedural shapes and of meshes of split `train`
that an Apache-2.0 file may be made from. RUN/weights holds what is shipped, and its NOTICE.
`--device cuda` trains on a GPU. With `--start WEIGHTS` the last round alone is trained: they teach
it, and it goes on from them. A trial (`--share 0.01`) has a folder of its own in RUN.
The same command goes on with a run that was stopped; what is finished is not made again. RUN holds
the weights of each finished round, `<round>.safetensors`: copied to another machine's RUN, that
round and those before it are not trained again there.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
import torch
import tyro
from experiments.mesh_credits import notice
from experiments.meshes import road_vehicles
from experiments.shipped_rounds import DATA, ROUNDS
from jaxtyping import Float32
from torch import Tensor
from torch.nn.functional import normalize

from experiments import calibrate_confidence, confidence, views_weights
from wildshape.cli.main import in_a_sentence
from wildshape.cli.terminal import TERMINAL, stoppable
from wildshape.errors import BadInputError
from wildshape.io.atomic import write_text
from wildshape.io.output import provenance
from wildshape.io.store.store import Store, is_finished_store, open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.checkpoint import (
    MODEL,
    fingerprint,
    load_checkpoint,
    save_checkpoint,
    weights_file,
)
from wildshape.ops.device import choose_device
from wildshape.ops.threads import exact_on
from wildshape.parallel.team import Team, cores, team
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulated_by
from wildshape.training.setup import setup
from wildshape.training.train import fit_with_progress

_SENSORS = ("hdl64", "hdl64", "hdl32", "os1-128")
_GROUND = 1  # of the sensors the one whose scans keep some ground
_SCANS, _SHAPE_POINTS = 16, 512
_STEP_M = 1.0  # of a vehicle that drives, from scan to scan
_COMMAND = "python -m experiments.shipped_chain --cad CAD --out RUN"
VIEWS: tuple[Literal["airplane", "chair", "car"], ...] = ("airplane", "chair", "car")
NAMES = ("default", *VIEWS)
_VIEW_STEPS = 5000  # of each of the two stages
_CALIBRATION_TRACKS = 60


@dataclass(frozen=True)
class Settings:
    """The chain.

    Attributes:
        out: folder of the run.
        cad: folder of CAD meshes with a manifest.
        share: of all tracks and steps; below 1 to try the chain, in a folder of its own.
        start: checkpoint, or the name of weights shipped, that teach the last round and that it
            goes on from; the rounds before are left out.
        only: weights that are made; `car` asks `default` of RUN/weights.
        device: of the trainings. On a GPU sums come in any order: two runs differ.
    """

    out: Path
    cad: Path
    share: float = 1.0
    start: Path | None = None
    only: tuple[Literal["default", "airplane", "chair", "car"], ...] = NAMES
    device: Literal["cpu", "cuda"] = "cpu"

    @property
    def rounds(self) -> tuple[str, ...]:
        """Their names, in order."""
        names = tuple(ROUNDS)
        return names if self.start is None else names[-1:]

    @property
    def unfinished(self) -> tuple[str, ...]:
        """The rounds after the last one that is finished; each asks for the one before it alone."""
        names = self.rounds
        done = [number for number, name in enumerate(names) if self.finished(name).exists()]
        return names[max(done) + 1 :] if done else names

    @property
    def command(self) -> str:
        """That makes such weights."""
        share = "" if self.share == 1 else f" --share {self.share:g}"
        start = "" if self.start is None else f" --start {self.start.name}"
        device = "" if self.device == "cpu" else f" --device {self.device}"
        return f"{_COMMAND}{share}{start}{device}"

    def part(self, count: int, least: int = 1) -> int:
        """So many tracks or steps of `count`."""
        return max(round(count * self.share), least)

    def checkpoint(self, name: str | None) -> Path | None:
        """Of a round, or the one that takes its place."""
        if name is None:
            return None
        return self.finished(name) if self.start is None else weights_file(self.start)

    def finished(self, name: str) -> Path:
        """Where the weights of a finished round are kept."""
        return self.out / f"{name}.safetensors"


def main(settings: Settings) -> None:
    """Every stage that is not finished, in order; one thread: sums do not depend on the machine."""
    torch.set_num_threads(1)
    if settings.share != 1:
        settings = replace(settings, out=settings.out / f"share-{settings.share:g}")
    weights = settings.out / "weights"
    weights.mkdir(parents=True, exist_ok=True)
    write_text(weights / "NOTICE", notice(settings.cad))
    if "default" in settings.only:
        _refuse_of_other_start(settings)
        for name in settings.unfinished:
            trained(name, settings)
        _shipped(settings.finished(settings.rounds[-1]), settings, "vehicle")
    for category in VIEWS:
        if category in settings.only:
            _views(category, settings)


def _refuse_of_other_start(settings: Settings) -> None:
    """A last round that other weights taught is not the one that is asked for."""
    last = settings.finished(settings.rounds[-1])
    if not last.exists():
        return
    made = load_checkpoint(last)[1].provenance
    if settings.start is None:
        other = " --start " in made["command"]
    else:
        other = made["identity"]["teacher"] != fingerprint(settings.start)
    if other:
        raise BadInputError(
            f"{last}: was made by `{made['command']}`, of other weights; repeat that, or choose"
            " another --out."
        )


def trained(name: str, settings: Settings) -> None:
    """A round's weights, in half precision: made now or resumed."""
    of, folder = ROUNDS[name], settings.out / name
    steps = settings.part(of.steps)
    data = _data(of.data, settings)  # before the bar, whose estimate it would spoil
    with TERMINAL.bar(f"round {name}: fusing tracks", 0) as bar:
        run = setup(
            of.recipe(steps),
            data,
            folder,
            seed=of.data,
            device=choose_device(settings.device),
            resume=True,
            teacher=settings.checkpoint(of.teacher),
            start=settings.checkpoint(of.start),
            fronts=driving(data) if of.driving else None,
            provenance=provenance(settings.command) | {"round": name},
            taught=lambda done, total: bar.at(done, total=total),
        )
    with exact_on(cores()):
        fit_with_progress(run, TERMINAL, stoppable, resume=settings.command)
    save_checkpoint(settings.finished(name), *load_checkpoint(folder / MODEL), half=True)


def driving(tracks: Iterable[Track]) -> Float32[Tensor, "S 3"]:
    """Where vehicles go, by the middles of their scans and the sensor's own motion: unit vectors.

    Each drives straight ahead, and the sensor so that it sees what it saw. Directions are in the
    sensor frame of each scan, all tracks one after the other.
    """
    ways = []
    for track in tracks:
        assert track.T_sensor_object is not None  # simulated
        T_world_sensor = track.T_sensor_object.inverse()
        T_world_sensor.translation[:, 0] += _STEP_M * torch.arange(len(track.scans))
        middles = torch.from_numpy(np.stack([scan.mean(0, np.float64) for scan in track.scans]))
        middles = T_world_sensor.apply(middles[:, None])[:, 0]
        ways.append((middles[-1] - middles[0]) @ T_world_sensor.rotation)
    return normalize(torch.cat(ways).float(), dim=-1)


def _data(seed: int, settings: Settings) -> Store:
    """Drives past procedural and CAD vehicles, simulated once; begun again if half-written."""
    path = settings.out / f"tracks{seed}"
    if not is_finished_store(path):
        with (
            StoreWriter(path, provenance(settings.command), overwrite=True) as store,
            team() as helpers,
        ):
            for number in range(len(_SENSORS)):
                _add_drives(store, number, seed, settings, helpers)
    return open_store(path)


def _add_drives(
    store: StoreWriter, number: int, seed: int, settings: Settings, helpers: Team
) -> None:
    """Those of one sensor."""
    tracks = DATA[seed]
    sets = 2 * len(tracks.varied)
    share = settings.part(tracks.count // (sets * len(_SENSORS)), least=4)
    config = SimulationConfig(
        tracks=share,
        scans=_SCANS,
        sensor=_SENSORS[number],
        occlusion=tracks.occlusion,
        rays=tracks.rays,
        ground=number == _GROUND,
        shape_points=_SHAPE_POINTS,
    )
    own = 1000 * seed + 100 * number
    with TemporaryDirectory() as folder:
        road_vehicles(settings.cad, Path(folder), share, own)
        sources = product(tracks.varied, (None, Path(folder)))
        for place, (varied, meshes) in enumerate(sources):
            drives = replace(config, meshes=meshes, varied=varied)
            for track in simulated_by(helpers, drives, own + place):
                store.add(replace(track, name=f"{config.sensor}-{own + place}-{track.name}"))


def _views(category: Literal["airplane", "chair", "car"], settings: Settings) -> None:
    """Weights of a depth camera; those of cars ask the vehicles' which way each view looks."""
    folder = settings.out / category
    headings = settings.out / "weights" / "default.safetensors" if category == "car" else None
    views_weights.main(
        views_weights.Settings(
            out=folder,
            cad=settings.cad,
            category=category,
            steps=settings.part(_VIEW_STEPS),
            taught_steps=settings.part(_VIEW_STEPS),
            headings=headings,
            device=settings.device,
        )
    )
    _shipped(folder / f"{category}.safetensors", settings, category)


def _shipped(
    model: Path, settings: Settings, category: Literal["vehicle", "airplane", "chair", "car"]
) -> None:
    """The weights with their confidence calibrated."""
    name = "default" if category == "vehicle" else category
    final = settings.out / "weights" / f"{name}.safetensors"
    if final.exists():
        return
    halved = settings.out / f"{name}-half.safetensors"
    network, found = load_checkpoint(model)
    described = replace(found, provenance=found.provenance | {"command": settings.command})
    save_checkpoint(halved, network, described, half=True)
    calibrated = settings.out / f"{name}-calibrated.safetensors"
    tracks = settings.part(_CALIBRATION_TRACKS if category != "vehicle" else 20, least=4)
    confidence.main(
        confidence.Settings(
            out=settings.out / f"{name}-confidence",
            model=halved,
            cad=settings.cad,
            write=calibrated,
            tracks=tracks,
            category=category,
        )
    )
    copyfile(_trusted(calibrated, settings) if category == "vehicle" else calibrated, final)


def _trusted(model: Path, settings: Settings) -> Path:
    """The vehicles' weights with probabilities of heading, box and kind."""
    written = settings.out / "default-trusted.safetensors"
    calibrate_confidence.main(
        calibrate_confidence.Settings(
            out=settings.out / "default-trust",
            model=model,
            write=written,
            streets=calibrate_confidence.STREETS[: settings.part(8, least=2)],
            share=settings.share,
        ),
        settings.command,
    )
    return written


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
