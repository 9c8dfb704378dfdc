# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Make the data and train the weights that the package ships.

    python -m experiments.default_weights --cad CAD_FOLDER --teacher TEACHER --out runs/default

A second round starts from the first and is taught by it:

    python -m experiments.default_weights --cad CAD_FOLDER --teacher ROUND1 --start ROUND1 \
        --seed 1 --tracks 2400 --lr 5e-4 --out runs/round2

CAD_FOLDER holds `manifest.csv` (columns category, file, split) and the meshes it names; vehicles of
split `train` are used, as they are and in other proportions, besides our own procedural ones.
Without --cad only the latter. TEACHER is a checkpoint trained as the paper has it
(`wildshape train DATA`, no teacher); it poses and fuses the tracks that the shipped weights are
then trained on.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import tyro
from experiments.meshes import road_vehicles

from wildshape.io.output import provenance
from wildshape.io.store.store import open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import PRESETS

STEPS, TRUTH = 22_000, Path("truth")
_SCANS = 20
_SENSORS = ("hdl64", "hdl64", "hdl32", "os1-128")


@dataclass(frozen=True)
class Settings:
    """How to make the shipped weights.

    Attributes:
        out: folder of the run.
        cad: folder of CAD meshes with a manifest.
        teacher: checkpoint that fuses the tracks; `truth` trains the oracle to compare with;
            without one, training begins from nothing.
        start: checkpoint whose weights are trained on, instead of random ones.
        tracks: simulated tracks, an eighth for each pair of sensor and source.
        steps: gradient steps.
        lr: learning rate to fall from; the preset's by default.
        preset: of `wildshape train`.
        seed: of data and training.
        resume: go on with a run that was stopped.
    """

    out: Path
    cad: Path | None = None
    teacher: Path | None = None
    start: Path | None = None
    tracks: int = 1600
    steps: int = STEPS
    lr: float | None = None
    preset: str = "default"
    seed: int = 0
    resume: bool = False


def make_data(settings: Settings, path: Path) -> None:
    """Write the store: every sensor, procedural and CAD vehicles, a quarter with ground left in."""
    described = provenance(f"python -m experiments.default_weights {settings}")
    share = settings.tracks // (len(_SENSORS) * (1 if settings.cad is None else 2))
    with StoreWriter(path, described) as store:
        for index, sensor in enumerate(_SENSORS):
            seed = settings.seed + 100 * index
            config = SimulationConfig(
                tracks=share, scans=_SCANS, sensor=sensor, ground=index == 1, shape_points=512
            )
            for track in simulate_tracks(config, seed):
                store.add(replace(track, name=f"{sensor}-{seed}-{track.name}"))
            if settings.cad is None:
                continue
            with TemporaryDirectory() as folder:
                road_vehicles(settings.cad, Path(folder), share, seed)
                for track in simulate_tracks(replace(config, meshes=Path(folder)), seed + 50):
                    store.add(replace(track, name=f"{sensor}-{seed + 50}-{track.name}"))


def main(settings: Settings) -> None:
    """Make the data if it is not there yet, then train."""
    data = settings.out / "data"
    settings.out.mkdir(parents=True, exist_ok=True)
    if not data.exists():
        make_data(settings, data)
    recipe = PRESETS[settings.preset]()
    rate = recipe.optim.lr if settings.lr is None else settings.lr
    recipe = replace(recipe, optim=replace(recipe.optim, steps=settings.steps, lr=rate))
    run = setup(
        recipe,
        open_store(data),
        settings.out,
        seed=settings.seed,
        resume=settings.resume,
        teacher="truth" if settings.teacher == TRUTH else settings.teacher,
        start=settings.start,
        taught=lambda done, total: (
            print(f"fused {done} of {total}", flush=True) if done % 100 == 0 else None
        ),
        provenance=provenance(f"python -m experiments.default_weights {settings}"),
    )
    model = fit(run, lambda step, values: print(step, values, flush=True))
    ship(model, settings)


def ship(model: Path, settings: Settings) -> None:
    """The same checkpoint in half precision, as the package carries it."""
    network, found = load_checkpoint(model)
    described = replace(found, provenance=found.provenance | {"command": command(settings)})
    save_checkpoint(settings.out / "default.safetensors", network, described, half=True)


def command(settings: Settings) -> str:
    """What makes such weights, without the paths of this machine."""
    given = ("cad", "teacher", "start")
    paths = "".join(f" --{name} {name.upper()}" for name in given if getattr(settings, name))
    paths = paths.replace("TEACHER", "truth") if settings.teacher == TRUTH else paths
    rate = "" if settings.lr is None else f" --lr {settings.lr:g}"
    how = f" --preset {settings.preset} --seed {settings.seed} --tracks {settings.tracks}{rate}"
    return f"python -m experiments.default_weights{paths}{how} --steps {settings.steps} --out RUN"


if __name__ == "__main__":
    main(tyro.cli(Settings))
