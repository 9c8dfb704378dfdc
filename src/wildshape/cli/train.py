# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape train`: learn from tracks; also under torchrun, where rank 0 alone talks."""

import os
import time
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from wildshape.cli.options import AsJson, Data, Device, Overwrite, Unit
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.cli.output import Output
    from wildshape.io.store import Store
    from wildshape.training.loop import Run

EXAMPLE = "wildshape train cars.store --out runs/cars --preset small"

Preset = Literal[
    "paper-lidar", "paper-views", "default", "small", "views", "tiny",
    "dpc", "dpc-dagger", "dpc-lidar", "dpc-small", "dpc-dagger-small", "dpc-lidar-small",
]  # fmt: skip
Encoder = Literal["pcn", "pointnet2", "dgcnn"]
OutRun = Annotated[Path, arg(metavar="RUN", help="folder of the run")]
_PACKED = "data.store"
_FILES = (
    "*.safetensors",
    "run.json",
    "log.jsonl",
    "profile.txt",
    "tensorboard/*",
    f"{_PACKED}/*",
)


@dataclass(frozen=True)
class Settings:
    """Train a model on tracks, without labels; RUN/model.safetensors is the result.

    Ctrl-C and SIGTERM save the state; `--resume` then goes on to the same weights as a run that
    was never stopped. Under `torchrun --nproc-per-node N -m wildshape.cli train ...` the
    processes train together.

    Attributes:
        preset: sizes, losses and schedule; dpc... is the learned baseline of the paper, for
            `evaluate` to stand beside ours.
        encoder: point network that reads a scan, at the preset's widths; by default PCN's.
        steps: gradient steps instead of the preset's; the schedule is stretched to them.
        seed: of weights and batches.
        resume: go on with RUN; a finished one is left as it is.
        profile: write where a step's time goes to RUN/profile.txt; the weights are the same.
        start: fine-tune these weights, a checkpoint of the same preset or `shipped`.
        teacher: train on the poses and fused shapes that this checkpoint (or `shipped`) finds
            for whole tracks, instead of from nothing; `truth` is the oracle.
        headings: with `--teacher`: ask this LiDAR checkpoint (or `shipped`) which way views look
            that come in no order, as a camera's do.
    """

    data: Data
    out: OutRun
    preset: Preset = "default"
    encoder: Encoder | None = None
    steps: Annotated[int | None, arg(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    resume: bool = False
    start: Annotated[str | None, arg(metavar="M")] = None
    teacher: Annotated[str | None, arg(metavar="M")] = None
    headings: Annotated[str | None, arg(metavar="M")] = None
    device: Device = "auto"
    unit: Unit = "m"
    overwrite: Overwrite = False
    profile: bool = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Train, or go on training.

    Raises:
        BadInputError: data or settings that cannot be used, an existing run without `--resume`.
        KeyboardInterrupt: stopped by a signal, the state saved.
    """
    from wildshape.cli.models import choose_device
    from wildshape.cli.output import command_line
    from wildshape.cli.terminal import progress, say
    from wildshape.cli.training import fit_with_progress, recipe_for
    from wildshape.io.provenance import provenance
    from wildshape.training.loop import setup
    from wildshape.training.profile import PROFILE
    from wildshape.training.recipes import with_encoder

    if settings.seed < 0:
        raise BadInputError(f"--seed {settings.seed}: expected 0 or more.")
    device = choose_device(settings.device)
    if settings.preset.startswith("dpc"):
        from wildshape.cli.train_dpc import DpcOrder, train_dpc

        order = DpcOrder.of(vars(settings), device)
        train_dpc(order, _check_folder(settings), partial(open_data, settings))
        return
    if settings.headings and settings.teacher in (None, "truth"):
        raise BadInputError(
            "--headings: decides which way a teacher's tracks look; pass --teacher M, too."
        )
    output = _check_folder(settings)
    try:
        store = open_data(settings)
        recipe = recipe_for(store, settings.preset, settings.steps)
        recipe = with_encoder(recipe, settings.encoder or recipe.network.backbone)
    except BadInputError:
        if output is not None:
            output.abandon()
        raise
    made = {**provenance(command_line()), "data": str(settings.data)}
    with progress("fusing tracks", 0, silent=settings.teacher in (None, "truth")) as bar:
        prepared = setup(
            recipe,
            store,
            settings.out,
            seed=settings.seed,
            device=device,
            resume=settings.resume,
            start=_checkpoint(settings.start),
            teacher="truth" if settings.teacher == "truth" else _checkpoint(settings.teacher),
            headings=_checkpoint(settings.headings),
            provenance=made,
            taught=lambda done, total: bar.at(done, total=total),
            say=say,
        )
    if settings.profile and prepared.processes.leads:
        prepared.profile = settings.out / PROFILE
    began, first = time.monotonic(), prepared.state.step
    if first >= recipe.optim.steps:
        _conclude(settings, prepared, 0.0, f"{settings.out} was finished already")
        return
    model = fit_with_progress(prepared, resume=f"{command_line()}{_flag(settings)}")
    text = f"trained {prepared.state.step - first} steps"
    _conclude(settings, prepared, time.monotonic() - began, text)
    assert model.is_file() or not prepared.processes.leads


def _checkpoint(model: str | None) -> Path | None:
    """The checkpoint that a user names."""
    from wildshape.cli.models import model_file

    if model is None:
        return None
    return model_file(None if model == "shipped" else Path(model))


def open_data(settings: Settings) -> "Store":
    """The packed store to train on; track folders are packed once into the run's folder.

    Raises:
        BadInputError: no tracks there; or track folders under torchrun.
    """
    from wildshape.cli.packing import write_tracks
    from wildshape.cli.reading import Reading
    from wildshape.cli.terminal import progress, say_skipped
    from wildshape.io.store import is_store, open_store

    if is_store(settings.data):
        return open_store(settings.data)
    if int(os.environ.get("WORLD_SIZE", "1")) > 1:
        raise BadInputError(
            f"{settings.data}: several processes need a packed store; make one first by"
            f" `wildshape convert folder {settings.data} OUT`."
        )
    packed = settings.out / _PACKED
    if settings.resume and (packed / "index.json").is_file():
        return open_store(packed)
    reading = Reading(settings.data, settings.unit)
    with progress("packing tracks", len(reading.source)) as bar:
        write_tracks(
            (track for _, track in reading.tracks()),
            packed,
            "packed",
            command="train",
            settings={"input": str(settings.data.resolve()), "unit": settings.unit},
            overwrite=True,
            at=bar.at,
        )
    say_skipped(reading.skipped)
    return open_store(packed)


def _check_folder(settings: Settings) -> "Output | None":
    """The marker of a new run; processes that do not lead leave the folder alone."""
    from wildshape.cli.output import MARKER, begin, keep_apart

    if int(os.environ.get("RANK", "0")) > 0:
        return None
    if settings.resume and (settings.out / MARKER).is_file():
        return None
    keep_apart(settings.data, settings.out)
    began = settings.out.is_dir() and any(settings.out.iterdir())
    if began and not settings.overwrite:
        raise BadInputError(
            f"{settings.out}: a run is there already; pass --resume to go on with it, --overwrite"
            " to replace it, or choose another --out."
        )
    parts = ("data", "preset", "encoder", "steps", "seed")
    identity = {name: str(getattr(settings, name)) for name in parts}
    return begin(settings.out, "train", identity, _FILES, overwrite=settings.overwrite)


def _flag(settings: Settings) -> str:
    return "" if settings.resume else " --resume"


def _conclude(settings: Settings, run: "Run", seconds: float, text: str) -> None:
    if not run.processes.leads:
        return
    import json

    from wildshape.cli.output import MARKER
    from wildshape.cli.terminal import answer, duration
    from wildshape.io.atomic import write_json
    from wildshape.models.checkpoint import load_checkpoint
    from wildshape.training.loop import MODEL

    marker = settings.out / MARKER
    write_json(marker, {**json.loads(marker.read_text("utf-8")), "status": "finished"})
    model = settings.out / MODEL
    _, saved = load_checkpoint(model)
    spent = f" in {duration(seconds)}" if seconds else ""
    data = {
        "model": str(model),
        "steps": run.state.step,
        "seconds": round(seconds, 3),
        "metrics": saved.metrics,
        "recipe": asdict(run.recipe),
    }
    answer(f"{text}{spent}; the model is {model}", data, as_json=settings.json)
