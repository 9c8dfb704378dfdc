# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Make the data and train the weights that the package ships.

    python experiments/default_weights.py --cad CAD_FOLDER --teacher TEACHER --out runs/default

A second round starts from the first and is taught by it:

    python experiments/default_weights.py --cad CAD_FOLDER --teacher ROUND1 --start ROUND1 \
        --seed 1 --tracks 2400 --lr 5e-4 --out runs/round2

CAD_FOLDER holds `manifest.csv` (columns category, file, split) and the meshes it names; vehicles of
split `train` are used, as they are and in other proportions, besides our own procedural ones.
Without --cad only the latter. TEACHER is a checkpoint trained as the paper has it
(`wildshape train DATA`, no teacher); it poses and fuses the tracks that the shipped weights are
then trained on.
"""

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import tyro

from wildshape.io.provenance import provenance
from wildshape.io.store import open_store
from wildshape.io.store_writer import StoreWriter
from wildshape.models.checkpoint import load_checkpoint, save_checkpoint
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import PRESETS

STEPS = 22_000
_STRETCH, _SCANS = np.array((0.12, 0.08, 0.08)), 20
_PARTS = ((4, 0.25), (1, 0.0), (3, 0.15))  # along each axis: how many, and the spread of their logs
_SENSORS = ("hdl64", "hdl64", "hdl32", "os1-128")


@dataclass(frozen=True)
class Sizes:
    """Length, width and height of road vehicles; how many copies; whether any length will do."""

    share: int
    least_m: tuple[float, float, float]
    most_m: tuple[float, float, float]
    any_length: bool = False


_VEHICLES = {
    "car": Sizes(1, (3.4, 1.5, 1.1), (5.3, 2.1, 2.1)),
    "truck": Sizes(2, (5.0, 1.9, 1.9), (12.0, 2.6, 4.0), any_length=True),
    "bus": Sizes(4, (7.0, 2.3, 2.7), (13.0, 2.6, 4.3), any_length=True),
}


@dataclass(frozen=True)
class Settings:
    """How to make the shipped weights.

    Attributes:
        out: folder of the run.
        cad: folder of CAD meshes with a manifest.
        teacher: checkpoint that fuses the tracks; without one, training begins from nothing.
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


def train_meshes(cad: Path, into: Path, count: int, seed: int) -> Path:
    """`count` vehicles of the train split, lorries and buses oftener than cars, shuffled.

    A mesh's first copy is as it is. The others are stretched, their parts of other lengths, and
    of sizes that are seen on roads, for many models are toys.
    """
    import trimesh

    with (cad / "manifest.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["split"] == "train"]
    rows = [row for row in rows if row["category"] in _VEHICLES]
    files = [row for row in rows for _ in range(_VEHICLES[row["category"]].share)]
    rng = np.random.default_rng(seed)
    drawn = [files[i] for _ in range(-(-count // len(files))) for i in rng.permutation(len(files))]
    seen: set[str] = set()
    for place, row in enumerate(drawn[:count]):
        name, sizes = row["file"], _VEHICLES[row["category"]]
        mesh = trimesh.load(cad / name, force="mesh", process=False)
        if name in seen:
            mesh.vertices = warped(np.asarray(mesh.vertices), sizes, rng)
        seen.add(name)
        mesh.export(into / f"{place:04d}_{Path(name).stem}.ply")
    return into


def warped(vertices: np.ndarray, sizes: Sizes, rng: np.random.Generator) -> np.ndarray:
    """Vertices (N, 3) of another vehicle: stretched, and its parts of other lengths."""
    low, high = vertices.min(0), vertices.max(0)
    size = (high - low) * rng.uniform(1 - _STRETCH, 1 + _STRETCH)
    if sizes.any_length:
        size[0] = rng.uniform(sizes.least_m[0], sizes.most_m[0])
    size = np.clip(size, sizes.least_m, sizes.most_m)
    out = np.empty_like(vertices, dtype=np.float64)
    for axis, (knots, spread) in enumerate(_PARTS):
        share = np.exp(rng.uniform(-spread, spread, knots))
        edges = np.concatenate(((0.0,), np.cumsum(share) / share.sum()))
        place = (vertices[:, axis] - low[axis]) / max(high[axis] - low[axis], 1e-9)
        out[:, axis] = np.interp(place, np.linspace(0, 1, knots + 1), edges) * size[axis]
    return out - (size[0] / 2, size[1] / 2, 0.0)


def make_data(settings: Settings, path: Path) -> None:
    """Write the store: every sensor, procedural and CAD vehicles, a quarter with ground left in."""
    described = provenance(f"python experiments/default_weights.py {settings}")
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
                meshes = train_meshes(settings.cad, Path(folder), share, seed)
                for track in simulate_tracks(replace(config, meshes=meshes), seed + 50):
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
        teacher=settings.teacher,
        start=settings.start,
        taught=lambda done, total: (
            print(f"fused {done} of {total}", flush=True) if done % 100 == 0 else None
        ),
        provenance=provenance(f"python experiments/default_weights.py {settings}"),
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
    rate = "" if settings.lr is None else f" --lr {settings.lr:g}"
    how = f" --preset {settings.preset} --seed {settings.seed} --tracks {settings.tracks}{rate}"
    return f"python experiments/default_weights.py{paths}{how} --steps {settings.steps} --out RUN"


if __name__ == "__main__":
    main(tyro.cli(Settings))
