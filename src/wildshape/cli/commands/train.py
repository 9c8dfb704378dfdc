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

from wildshape.cli.options import AT_ORIGIN, AsJson, Data, Device, Origin, Overwrite, Unit, option
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.cli.output import Output
    from wildshape.io.store.store import Store
    from wildshape.training.loop import Run

EXAMPLES = (
    "wildshape train cars.store --out runs/cars --preset small",
    "wildshape train cars.store --out runs/cars --preset small --resume",
    "wildshape train cars.store --out runs/taught --teacher runs/cars/model.safetensors",
    "torchrun --nproc-per-node 2 -m wildshape.cli train cars.store --out runs/paper"
    " --preset paper-lidar",
)

PRESETS = {
    "default": "the shipped weights' recipe, 30,000 steps",
    "small": "fewer points, 12,000 steps: minutes on two cores",
    "views": "depth views of objects of unit size, 8,000 steps",
    "paper-lidar": "exactly the paper, LiDAR: 400,000 steps",
    "paper-views": "exactly the paper, depth views: 300,000 steps",
    "tiny": "for tests: 500 steps, learns little",
    "dpc": "the paper's learned baseline; camera, rotation alone",
    "dpc-dagger": "that baseline with a translation, too",
    "dpc-lidar": "that baseline on a LiDAR's polar images",
    "dpc-small": "dpc at half its resolution, 6,000 steps",
    "dpc-dagger-small": "dpc-dagger likewise, 6,000 steps",
    "dpc-lidar-small": "dpc-lidar likewise, 6,000 steps",
}
Preset = Annotated[
    Literal[
        "default", "small", "views", "paper-lidar", "paper-views", "tiny",
        "dpc", "dpc-dagger", "dpc-lidar", "dpc-small", "dpc-dagger-small", "dpc-lidar-small",
    ],
    option(
        metavar="NAME",
        help="\n".join(
            ("sizes, losses and schedule:", *(f"  {n}: {what}" for n, what in PRESETS.items()), "")
        ),
    ),
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
    encoder: Annotated[Encoder | None, option(metavar="{pcn,pointnet2,dgcnn}")] = None
    steps: Annotated[int | None, option(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    resume: bool = False
    start: Annotated[str | None, option(metavar="M")] = None
    teacher: Annotated[str | None, option(metavar="M")] = None
    headings: Annotated[str | None, option(metavar="M")] = None
    device: Device = "auto"
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
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
    from wildshape.cli.training.recipe import fit_with_progress, recipe_for
    from wildshape.io.provenance import provenance
    from wildshape.training.loop import setup
    from wildshape.training.recipes import with_encoder
    from wildshape.training.runtime.profiler import PROFILE

    if settings.seed < 0:
        raise BadInputError(f"--seed {settings.seed}: expected 0 or more.")
    device = choose_device(settings.device)
    if settings.preset.startswith("dpc"):
        from wildshape.cli.training.dpc import DpcOrder, train_dpc

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
    from wildshape.cli.input.tracks import Reading
    from wildshape.cli.packing import write_tracks
    from wildshape.cli.terminal import progress, say_skipped
    from wildshape.io.scans.points import Coordinates
    from wildshape.io.store.store import is_store, open_store

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
    coordinates = Coordinates(settings.unit, settings.origin)
    reading = Reading(settings.data, coordinates)
    with progress("packing tracks", len(reading.source)) as bar:
        write_tracks(
            (track for _, track in reading.tracks()),
            packed,
            "packed",
            command="train",
            settings={"input": str(settings.data.resolve()), **asdict(coordinates)},
            overwrite=True,
            at=bar.at,
        )
    say_skipped(reading.skipped)
    return open_store(packed)


def _check_folder(settings: Settings) -> "Output | None":
    """The marker of a new run; processes that do not lead leave the folder alone."""
    from wildshape.cli.output import MARKER, begin, is_begun, keep_apart, remove_leftovers
    from wildshape.io.atomic import lock_folder

    if int(os.environ.get("RANK", "0")) > 0:
        return None
    if settings.resume and (settings.out / MARKER).is_file():
        lock_folder(settings.out)
        remove_leftovers(settings.out)
        return None
    keep_apart(settings.data, settings.out)
    if is_begun(settings.out) and not settings.overwrite:
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
    from wildshape.method.checkpoint import load_checkpoint
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
