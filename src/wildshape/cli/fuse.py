# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape fuse`: all scans of a track as one cloud."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Device, Model, Overwrite, Refine, Together, Unit

EXAMPLE = "wildshape fuse track --out fused.ply"

TrackFolder = Annotated[Path, Positional, arg(metavar="TRACK", help="a TRACK folder")]
OutFile = Annotated[Path, arg(metavar="FILE", help="cloud to write: .ply .npy .xyz .txt .las .laz")]


@dataclass(frozen=True)
class Settings:
    """Join all scans of a track into one cloud, in the middle scan's sensor frame, metres."""

    track: TrackFolder
    out: OutFile
    model: Model = None
    unit: Unit = "m"
    device: Device = "auto"
    together: Together = False
    refine: Refine = "joint"
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Fuse one track.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    from wildshape.cli.models import load_model
    from wildshape.cli.output import refuse_file
    from wildshape.cli.reading import Reading
    from wildshape.cli.results import check_refine
    from wildshape.cli.terminal import answer, say, say_skipped
    from wildshape.geometry.se3 import stack
    from wildshape.inference.registering import fuse_scans, to_middle
    from wildshape.io.cloud_writer import check_suffix, write_cloud

    check_refine(settings.refine, track=settings.together)
    check_suffix(settings.out)
    refuse_file(settings.out, overwrite=settings.overwrite)
    reading = Reading(settings.track, settings.unit)
    track = reading.single("fuse")
    predictor = load_model(settings.model, settings.device)
    if settings.together:
        done = predictor.complete_track(track.scans, track.sensor, refine=settings.refine)
    else:
        done = list(predictor.complete_many(track.scans, track.sensor))
    fused = fuse_scans(track.scans, to_middle(stack([scan.pose for scan in done])))
    write_cloud(settings.out, fused)
    say_skipped(reading.skipped)
    warnings = [scan.warning for scan in done if scan.warning]
    if warnings:
        say(f"{len(warnings)} scans are flagged, do not trust the result: {warnings[0]}")
    middle = track.scan_names[track.middle]
    text = (
        f"fused {len(track.scans)} scans, {len(fused)} points, in the frame of scan {middle};"
        f" see {settings.out}"
    )
    data = {"out": str(settings.out), "points": len(fused), "scans": len(track.scans)}
    data |= {"flagged": len(warnings), "uses": "track" if settings.together else "scan"}
    answer(text, {**data, "middle_scan": middle}, as_json=settings.json)
