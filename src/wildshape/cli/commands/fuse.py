# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape fuse`: all scans of a track as one cloud."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import DEFAULT_SCANS, Scans
from wildshape.errors import BadInputError

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
    scans: Scans = DEFAULT_SCANS


def run(settings: Settings) -> None:
    """Fuse one track.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    with uncollected():
        from wildshape.cli.terminal import answer, say, say_skipped
        from wildshape.geometry.transforms.se3 import stack
        from wildshape.inference.confidence import ReasonCounts
        from wildshape.inference.predictor import load
        from wildshape.inference.registration import fuse_scans, to_middle
        from wildshape.io.inputs import open_tracks
        from wildshape.io.output import begin_file
        from wildshape.io.progress import counted
        from wildshape.io.scans.writers import check_suffix, write_cloud

    asked = settings.scans
    check_suffix(settings.out)
    begin_file(settings.out, overwrite=asked.overwrite)
    _keep_out(settings.track, settings.out)
    source = open_tracks(settings.track, asked.files.coordinates)
    track = source.single("fuse")
    predictor = load(asked.network.model, asked.network.device)
    found = predictor.complete_checked(
        track.scans, track.sensor, track=asked.together, rays=track.rays
    )
    done = [replace(one, points=one.points[:0].copy()) for one in found]  # poses alone are needed
    fused = fuse_scans(track.scans, to_middle(stack([scan.pose for scan in done])))
    write_cloud(settings.out, fused)
    for told in source.doubts:
        say(told)
    say_skipped(source.skipped)
    reasons = ReasonCounts().of(track.scan_names, done)
    if reasons.flagged:
        say(reasons.sentence)
    middle = track.scan_names[track.middle]
    text = (
        f"fused {counted(len(track.scans), 'scan')}, {len(fused)} points, in the frame of scan"
        f" {middle}; see {settings.out}"
    )
    data = {"out": str(settings.out), "points": len(fused), "scans": len(track.scans)}
    data |= {**reasons.data, "uses": "track" if asked.together else "scan"}
    answer(text, {**data, "middle_scan": middle}, as_json=asked.json)


def _keep_out(track: Path, out: Path) -> None:
    """Refuse a cloud in place of what was read, or where it would be read the next time.

    Raises:
        BadInputError: it would lie there.
    """
    folder = track if track.is_dir() else track.parent
    scans = (folder / "scans" if (folder / "scans").is_dir() else folder).resolve()
    in_track, place = scans.name == "scans", out.resolve()
    among = place.parent == scans and (in_track or track.is_dir())
    truth = in_track and place in (scans.parent / "shape.ply", scans.parent / "poses.txt")
    if among or truth or place == track.resolve():
        raise BadInputError(
            f"{out}: lies among the scans of {track} or is its truth, and would be taken for that"
            " the next time; choose another place to write."
        )
