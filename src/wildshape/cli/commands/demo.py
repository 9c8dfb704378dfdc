# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape demo`: the whole way in five minutes, ending in one HTML page."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from wildshape.cli.options import DEFAULT_FILES, AsJson, Files, OutFolder, Overwrite, option

EXAMPLES = (
    "wildshape demo --out demo",
    "wildshape demo --out demo --data mytracks",
    "wildshape demo --out long --preset default --seconds 1800",
)

OwnData = Annotated[
    Path | None, option(metavar="DIR", help="your own track folders instead of simulated ones")
]


@dataclass(frozen=True)
class Settings:
    """Simulate, train, evaluate, complete, register, fuse, and draw it all in DIR/report.html.

    At last a whole simulated drive, the vehicles in it found: DIR/drive/found/report.html.

    Attributes:
        seconds: for training; the rest takes two to three minutes more.
        drive_scans: of the simulated drive in the end, ten a second; 0 leaves it out.
        tracks: simulated to train on.
        test_tracks: never trained on, to look at and to measure.
        preset: what is trained.
    """

    out: OutFolder = Path("demo")
    data: OwnData = None
    seconds: Annotated[float, arg(metavar="S")] = 95.0
    tracks: Annotated[int, arg(metavar="N")] = 200
    test_tracks: Annotated[int, arg(metavar="N")] = 12
    drive_scans: Annotated[int, arg(metavar="N")] = 100
    preset: Literal["small", "default", "tiny"] = "small"
    files: Files = DEFAULT_FILES
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """The whole way.

    Raises:
        BadInputError: the user's data cannot be used, or a demo is there already.
    """
    from wildshape.cli.terminal import TERMINAL, answer, stoppable
    from wildshape.report.demo.run import run_demo
    from wildshape.report.demo.tracks import DemoOptions

    options = DemoOptions(
        data=settings.data,
        coordinates=settings.files.coordinates,
        tracks=settings.tracks,
        test_tracks=settings.test_tracks,
        preset=settings.preset,
        seconds=settings.seconds,
        drive_scans=settings.drive_scans,
        overwrite=settings.overwrite,
    )
    found = run_demo(settings.out, options, TERMINAL, stoppable)
    text = "\n".join((*found.verdict, f"the report is {found.report}"))
    data = {"report": str(found.report), "verdict": found.verdict}
    answer(text, data, as_json=settings.json)
