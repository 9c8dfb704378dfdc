# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape fuse`: all scans of a track as one cloud."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from wildshape.cli.options import (
    AT_ORIGIN,
    AsJson,
    Device,
    Model,
    Origin,
    Overwrite,
    Together,
    Unit,
)

EXAMPLES = (
    "wildshape fuse track --out fused.ply",
    "wildshape fuse mytracks/car-17 --out car-17.laz --track",
)

TrackFolder = Annotated[Path, Positional, arg(metavar="TRACK", help="a TRACK folder")]
OutFile = Annotated[
    Path, arg(metavar="FILE", help="cloud to write: .ply .pcd .npy .xyz .txt .las .laz")
]


@dataclass(frozen=True)
class Settings:
    """Join all scans of a track into one cloud, in the middle scan's sensor frame, metres."""

    track: TrackFolder
    out: OutFile
    model: Model = None
    unit: Unit = "m"
    origin: Origin = AT_ORIGIN
    device: Device = "auto"
    together: Together = False
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Fuse one track.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    from wildshape.cli.input.tracks import Reading
    from wildshape.cli.models import load_model
    from wildshape.cli.output import refuse_file
    from wildshape.cli.results.tally import Doubts
    from wildshape.cli.terminal import answer, counted, say, say_skipped
    from wildshape.geometry.transforms.se3 import stack
    from wildshape.inference.registration import fuse_scans, to_middle
    from wildshape.io.scans.points import Coordinates
    from wildshape.io.scans.writers import check_suffix, write_cloud

    check_suffix(settings.out)
    refuse_file(settings.out, overwrite=settings.overwrite)
    reading = Reading(settings.track, Coordinates(settings.unit, settings.origin))
    track = reading.single("fuse")
    predictor = load_model(settings.model, settings.device)
    if settings.together:
        done = predictor.complete_track(track.scans, track.sensor)
    else:
        done = list(predictor.complete_many(track.scans, track.sensor))
    fused = fuse_scans(track.scans, to_middle(stack([scan.pose for scan in done])))
    write_cloud(settings.out, fused)
    say_skipped(reading.skipped)
    doubts = Doubts().of(track.scan_names, done)
    if doubts.flagged:
        say(doubts.sentence)
    middle = track.scan_names[track.middle]
    text = (
        f"fused {counted(len(track.scans), 'scan')}, {len(fused)} points, in the frame of scan"
        f" {middle}; see {settings.out}"
    )
    data = {"out": str(settings.out), "points": len(fused), "scans": len(track.scans)}
    data |= {**doubts.data, "uses": "track" if settings.together else "scan"}
    answer(text, {**data, "middle_scan": middle}, as_json=settings.json)
