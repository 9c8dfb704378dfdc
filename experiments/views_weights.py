# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Make depth views of a category and train weights for them, in one stage or two.

    python -m experiments.views_weights --category airplane --cad CAD_FOLDER --out runs/airplane

CAD_FOLDER holds `manifest.csv` (columns category, file, split) and the meshes it names. Those of
split `train` are seen as they are and stretched, beside our own procedural shapes; ten views of
each, no labels. The first stage learns from the views alone (preset `views`); a second, left out
by default, starts from it and is taught by it: it poses and fuses the tracks. A car's two ends are
too alike for views in no order, so that the second stage of cars asks the shipped LiDAR weights
which way each view looks (`--headings src/wildshape/weights/default.safetensors`). The weights, in
half precision, are OUT/CATEGORY.safetensors.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import tyro
from experiments.meshes import stretched

from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError
from wildshape.io.output import provenance
from wildshape.io.store.store import is_finished_store, open_store
from wildshape.io.store.writer import StoreWriter
from wildshape.method.checkpoint import load_checkpoint, save_checkpoint
from wildshape.ops.device import choose_device
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.config import Recipe
from wildshape.training.loop import fit, setup
from wildshape.training.recipes import views

_COPIES, _VIEWS, _TRUTH_POINTS = 4, 10, 2048


@dataclass(frozen=True)
class Settings:
    """How to make the weights of a category.

    Attributes:
        out: folder of both runs.
        cad: folder of CAD meshes with a manifest.
        category: of the objects.
        steps: gradient steps of the first stage.
        taught_steps: of the second; 0 ends with the first.
        taught_lr: learning rate that the second falls from.
        headings: checkpoint of LiDAR scans that the second stage asks which way the views look.
        seed: of data and training.
        device: of the trainings.
    """

    out: Path
    cad: Path
    category: Literal["airplane", "chair", "car"]
    steps: int = 3500
    taught_steps: int = 0
    taught_lr: float = 7e-4
    headings: Path | None = None
    seed: int = 0
    device: Literal["cpu", "cuda"] = "cpu"


def make_data(settings: Settings, path: Path) -> None:
    """Write the store: CAD meshes, and half as many procedural shapes, ten views of each."""
    described = provenance(f"python -m experiments.views_weights {settings}")
    with TemporaryDirectory() as folder, StoreWriter(path, described, overwrite=True) as store:
        count = stretched(settings.cad, Path(folder), settings.category, _COPIES, settings.seed)
        sources = ((Path(folder), _COPIES * count), (None, 2 * count))
        for seed, (meshes, tracks) in enumerate(sources, start=settings.seed + 1):
            config = SimulationConfig(
                tracks=tracks,
                scans=_VIEWS,
                sensor="depth-camera",
                category=settings.category,
                meshes=meshes,
                shape_points=_TRUTH_POINTS,
            )
            for track in simulate_tracks(config, seed):
                store.add(replace(track, name=f"{seed}-{track.name}"))


def main(settings: Settings) -> None:
    """Make the data if it is not there yet, then train both stages."""
    data = settings.out / "data"
    settings.out.mkdir(parents=True, exist_ok=True)
    if not is_finished_store(data):
        make_data(settings, data)
    if (held := open_store(data).track(0).category) != settings.category:
        raise BadInputError(f"{data}: holds views of {held}s; give another --out.")
    recipe = views()
    first = replace(recipe, optim=replace(recipe.optim, steps=settings.steps))
    model = train(settings, first, "first")
    optim = replace(recipe.optim, steps=settings.taught_steps, lr=settings.taught_lr)
    if settings.taught_steps:
        model = train(settings, replace(recipe, optim=optim), "taught0", teacher=model)
    ship(model, settings)


def train(settings: Settings, recipe: Recipe, name: str, teacher: Path | None = None) -> Path:
    """One stage, begun from its teacher if it has one, and resumed if it was stopped."""
    run = setup(
        recipe,
        open_store(settings.out / "data"),
        settings.out / name,
        seed=settings.seed,
        device=choose_device(settings.device),
        resume=True,
        start=teacher,
        teacher=teacher,
        headings=settings.headings if teacher else None,
        provenance=provenance(f"python -m experiments.views_weights {settings}"),
    )
    return fit(run, lambda step, values: print(name, step, values, flush=True))


def ship(model: Path, settings: Settings) -> None:
    """The same checkpoint in half precision, as the package carries it."""
    network, found = load_checkpoint(model)
    stages = f"--steps {settings.steps} --taught-steps {settings.taught_steps}"
    same = settings.taught_lr == Settings.taught_lr
    stages += "" if same else f" --taught-lr {settings.taught_lr:g}"
    stages += " --headings DEFAULT" if settings.headings else ""
    stages += "" if settings.device == "cpu" else f" --device {settings.device}"
    what = f"--category {settings.category} --cad CAD --out RUN {stages} --seed {settings.seed}"
    command = {"command": f"python -m experiments.views_weights {what}"}
    described = replace(found, provenance=found.provenance | command)
    out = settings.out / f"{settings.category}.safetensors"
    save_checkpoint(out, network, described, half=True)


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
