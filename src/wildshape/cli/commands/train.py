# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape train`: learn from tracks; also under torchrun, where rank 0 alone talks."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from tyro.conf import arg

from wildshape.cli.options import DEFAULT_FILES, AsJson, Data, Device, Files, Overwrite, option
from wildshape.method.encoders.named import Backbone

EXAMPLES = (
    "wildshape train cars.store --out runs/cars --preset small",
    "wildshape train cars.store --out runs/cars --preset small --resume",
    "wildshape train cars.store --out runs/taught --teacher runs/cars/model.safetensors",
    "torchrun --nproc-per-node 2 -m -- wildshape.cli train cars.store --out runs/paper"
    " --preset paper-lidar",
)

PRESETS = {
    "default": "a network as wide as the shipped one, 30,000 steps",
    "small": "fewer points, 12,000 steps: 20 minutes at best",
    "views": "depth views of objects of unit size, 8,000 steps",
    "paper-lidar": "the paper's form, LiDAR: 400,000 steps",
    "paper-views": "the paper's form, depth views: 300,000 steps",
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
Encoder = Annotated[Backbone | None, option(metavar="{" + ",".join(get_args(Backbone)) + "}")]
OutRun = Annotated[Path, arg(metavar="RUN", help="folder of the run")]


@dataclass(frozen=True)
class Settings:
    """Train a model on tracks, without labels; RUN/model.safetensors is the result.

    Ctrl-C and SIGTERM save the state; `--resume` then goes on to the same weights as a run that
    was never stopped. Under `torchrun --nproc-per-node N -m -- wildshape.cli train ...` the
    processes train together; without the `--` torchrun takes `--start` for its own.

    Attributes:
        encoder: point network that reads a scan, at the preset's widths; by default PCN's.
        steps: gradient steps instead of the preset's; the schedule is stretched to them, all but
            the warm-up.
        seed: of the first weights and the batches.
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
    encoder: Encoder = None
    steps: Annotated[int | None, option(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    resume: bool = False
    start: Annotated[str | None, option(metavar="M")] = None
    teacher: Annotated[str | None, option(metavar="M")] = None
    headings: Annotated[str | None, option(metavar="M")] = None
    device: Device = "auto"
    files: Files = DEFAULT_FILES
    overwrite: Overwrite = False
    profile: bool = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Train, or go on training.

    Raises:
        BadInputError: data or settings that cannot be used, an existing run without `--resume`.
        KeyboardInterrupt: stopped by a signal, the state saved.
    """
    from wildshape.cli.terminal import TERMINAL, answer, stoppable
    from wildshape.training.options import TrainingOptions
    from wildshape.training.train import train

    options = TrainingOptions(
        preset=settings.preset,
        encoder=settings.encoder,
        steps=settings.steps,
        seed=settings.seed,
        resume=settings.resume,
        start=settings.start,
        teacher=settings.teacher,
        headings=settings.headings,
        device=settings.device,
        coordinates=settings.files.coordinates,
        overwrite=settings.overwrite,
        profile=settings.profile,
    )
    if settings.preset.startswith("dpc"):
        from wildshape.baselines.dpc.train import train_dpc as train
    trained = train(settings.data, settings.out, options, TERMINAL, stoppable)
    if trained.leads:
        answer(trained.sentence, trained.data, as_json=settings.json)
