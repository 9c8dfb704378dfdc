# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape register`: two scans of one object, or all scans of a track."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import (
    DEFAULT_SCANS,
    DEFAULT_WORK,
    Format,
    Scans,
    Work,
    is_pipe,
    option,
    refuse_folder_options,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.records import Track

EXAMPLES = (
    "wildshape register before.ply after.ply",
    "wildshape register mytracks/car-17 --out car-17 --track",
    "wildshape register mytracks --out registered --track",
)

_FEW = 0.05  # of the source's points, on the target's

Source = Annotated[
    Path,
    Positional,
    arg(metavar="SOURCE", help="a scan, or - for stdin; without TARGET a TRACK or DATASET"),
]
Target = Annotated[
    Path | None,
    Positional,
    option(metavar="TARGET", help="the scan to whose frame SOURCE is taken, or -"),
]
Out = Annotated[Path | None, option(metavar="DIR", help="folder to write, with a TRACK")]


@dataclass(frozen=True)
class Settings:
    """Register SOURCE to TARGET, or every scan of a TRACK to its middle scan.

    Two scans: prints T_target_source, which takes the source's points to the target's sensor
    frame, and the share of them that then lie near the target. A TRACK: writes
    DIR/TRACK/poses.txt (T_sensor_canonical, KITTI's format), trajectory.tum (the same in TUM's),
    trajectory.json (the same with smoothness figures), T_middle_scan.txt, objects.json and the
    completed shapes.
    """

    source: Source
    target: Target = None
    out: Out = None
    scans: Scans = DEFAULT_SCANS
    format: Format = "auto"
    work: Work = DEFAULT_WORK


def run(settings: Settings) -> None:
    """Register a pair or tracks.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    if settings.target is not None and settings.out is not None:
        raise BadInputError(
            "register SOURCE TARGET prints its result; leave --out away, or name one TRACK alone."
        )
    if settings.target is not None and settings.scans.together:
        raise BadInputError("--track poses the scans of a TRACK together; a pair has no track.")
    if settings.format != "auto" and not (is_pipe(settings.source) or is_pipe(settings.target)):
        raise BadInputError(f"--format {settings.format}: is for a scan on stdin; leave it away.")
    if settings.target is not None:
        _pair(settings, settings.target)
    elif settings.out is not None:
        _tracks(settings, settings.out)
    else:
        raise BadInputError("register needs SOURCE and TARGET scans, or a TRACK and --out DIR.")


def _tracks(settings: Settings, out: Path) -> None:
    with uncollected():
        from wildshape.cli.terminal import TERMINAL, conclude
        from wildshape.inference.folders.complete_folder import complete_folder

    options = settings.scans.of_folder(settings.work)
    found = complete_folder(settings.source, out, options, TERMINAL, registers=True)
    conclude(found, as_json=settings.scans.json)


def _pair(settings: Settings, target: Path) -> None:
    from wildshape.cli.terminal import answer, say
    from wildshape.inference.confidence import reasons_sentence
    from wildshape.inference.predictor import load

    if is_pipe(settings.source) and is_pipe(target):
        raise BadInputError("register - -: stdin holds one scan; name a file for the other.")
    refuse_folder_options(
        settings.work, overwrite=settings.scans.overwrite, prints="register SOURCE TARGET"
    )
    source, target_track = (_scan(path, settings) for path in (settings.source, target))
    predictor = load(settings.scans.network.model, settings.scans.network.device)
    rays = [one for track in (source, target_track) for one in track.rays or (None,)]
    found = predictor.register(source.scans[0], target_track.scans[0], source.sensor, rays=rays)
    matrix = found.T_target_source.matrix.tolist()
    lines = [" ".join(f"{value:z12.6f}" for value in row) for row in matrix]
    shares = f"inlier ratio {found.inlier_ratio:.3f}, confidence {found.confidence:.3f}"
    data = {
        "T_target_source": matrix,
        "inlier_ratio": found.inlier_ratio,
        "confidence": found.confidence,
        "warning": found.warning,
        "reasons": found.reasons,
    }
    if found.reasons:
        say(reasons_sentence(found))
    if found.inlier_ratio < _FEW:
        say("hardly any points lie on each other: the scans show different sides, or objects.")
    answer("\n".join(("T_target_source", *lines, shares)), data, as_json=settings.scans.json)


def _scan(path: Path, settings: Settings) -> "Track":
    from wildshape.cli.pipe import as_file
    from wildshape.cli.terminal import say
    from wildshape.io.inputs import open_tracks

    kind = settings.format if is_pipe(path) else "auto"
    with as_file(path, kind) as file:
        source = open_tracks(file, settings.scans.files.coordinates)
        track = source.single("a pair")
    if len(track.scans) != 1:
        raise BadInputError(
            f"{path}: holds {len(track.scans)} scans, but a pair takes two files of one scan each;"
            " for a whole track name it alone with --out DIR."
        )
    for told in source.doubts:
        say(f"{path}: {told}")
    return track
