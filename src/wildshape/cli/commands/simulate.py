# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape simulate`: tracks with truth, by ray casting."""

import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from wildshape.cli.options import AsJson, Layout, Overwrite, option
from wildshape.errors import BadInputError
from wildshape.simulate.sensor import SensorName

if TYPE_CHECKING:
    from wildshape.simulate.config import SimulationConfig
    from wildshape.simulate.street.whole_drive import StreetConfig

EXAMPLES = (
    "wildshape simulate cars.store --tracks 200 --seed 1",
    "wildshape simulate views.store --sensor depth-camera --category chair --tracks 50",
    "wildshape simulate mytracks --meshes mymeshes --layout folders",
    "wildshape simulate street --drive --scans 100 --seed 1",
)

Out = Annotated[Path, Positional, arg(metavar="OUT", help="packed store, or folder, to write")]
Meshes = Annotated[
    Path | None,
    option(
        metavar="DIR",
        help="your own meshes (x forward, z up; glTF: z forward, y up) instead of our shapes",
    ),
]

OF_TRACKS = ("tracks", "category", "occlusion", "ground", "rays", "varied", "layout", "workers")
OF_DRIVES = ("speed", "compensated", "point_times")


@dataclass(frozen=True)
class Settings:
    """Simulate tracks: objects seen by a sensor that passes them, with true poses and shapes.

    With --drive: one drive through a street, all of each scan, in KITTI tracking's layout.

    Attributes:
        tracks: how many objects.
        scans: of a track, usable ones: by default 24 of a LiDAR, 5 of the depth camera; of a drive:
            by default 100.
        seed: the same seed gives the same tracks.
        sensor: model of the LiDAR, or the depth camera.
        category: of our shapes, by default car; airplane and chair need the depth camera; of your
            own meshes: what their tracks are called.
        occlusion: probability that something stands in the way in a LiDAR track, by default 0.3.
        ground: keep ground returns within 0.3 m of the object.
        rays: also keep the rays around each scan that did not hit the object (LiDAR).
        varied: to train for real scans: more sizes and forms, sensors that differ, and scans cut
            off above the ground.
        workers: processes; by default one per core.
        drive: full scans of a street with traffic, their boxes and the sensor's way.
        speed: of the vehicle in a drive, mean, metres per second; by default drawn from 4 to 10; 0
            stands still.
        compensated: of a drive: points as seen from the sensor's place at the middle of the scan.
        point_times: of a drive: also write PLY scans with the time of each point.
    """

    out: Out
    tracks: Annotated[int, arg(metavar="N")] = 100
    scans: Annotated[int | None, option(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    sensor: SensorName = "hdl64"
    meshes: Meshes = None
    category: Annotated[
        Literal["car", "airplane", "chair"] | None, option(metavar="{car,airplane,chair}")
    ] = None
    occlusion: Annotated[float | None, option(metavar="P")] = None
    ground: bool = False
    rays: bool = False
    varied: bool = False
    layout: Layout = "packed"
    workers: Annotated[int | None, option(metavar="N")] = None
    drive: bool = False
    speed: Annotated[float | None, option(metavar="V")] = None
    compensated: bool = False
    point_times: bool = False
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Simulate and write.

    Raises:
        BadInputError: a setting out of range, a mesh that cannot be used, or an existing output.
        MissingExtraError: the ray caster is not installed.
    """
    if settings.seed < 0:
        raise BadInputError(f"--seed {settings.seed}: expected 0 or more.")
    _refuse(settings, OF_TRACKS if settings.drive else OF_DRIVES)
    if settings.compensated and settings.point_times:
        raise BadInputError(
            "--compensated scans with --point-times would be corrected twice; pass one."
        )
    if settings.drive:
        _drive(settings)
    else:
        _tracks(settings)


def _refuse(settings: Settings, foreign: tuple[str, ...]) -> None:
    """Refuse options that would change nothing.

    Raises:
        BadInputError: one is given.
    """
    for name in foreign:
        if getattr(settings, name) != getattr(Settings, name):
            said = "means nothing with" if settings.drive else "needs"
            option = name.replace("_", "-")
            raise BadInputError(f"--{option} {said} --drive; leave it out.")


def _drive(settings: Settings) -> None:
    from wildshape.cli.terminal import TERMINAL, answer
    from wildshape.io.output import begin
    from wildshape.io.progress import counted, duration
    from wildshape.simulate.street.drive_folder import FILES, write_drive
    from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

    began = time.monotonic()
    config = StreetConfig(
        scans=100 if settings.scans is None else settings.scans,
        sensor=settings.sensor,
        meshes=settings.meshes,
        speed=settings.speed,
        compensated=settings.compensated,
    )
    _doubt(config.meshes)
    drive = WholeDrive(config, settings.seed)
    identity = {**_identity(config, settings), "point_times": settings.point_times}
    output = begin(
        settings.out,
        "simulate",
        identity,
        FILES,
        overwrite=settings.overwrite,
        progress=TERMINAL,
    )
    with TERMINAL.bar("simulating", config.scans) as bar:
        written = write_drive(drive, settings.out, bar.at, point_times=settings.point_times)
    output.finish()
    seconds = time.monotonic() - began
    text = (
        f"simulated {counted(written.scans, 'scan')}, {counted(written.points, 'point')},"
        f" {counted(written.vehicles, 'vehicle')} in {duration(seconds)}; see {settings.out}"
    )
    data = {"out": str(settings.out), **asdict(written), "seconds": round(seconds, 3)}
    answer(text, data, as_json=settings.json)


def _identity(config: "StreetConfig | SimulationConfig", settings: Settings) -> dict[str, Any]:
    """What decides the scans; meshes may be added or replaced between two runs."""
    from wildshape.io.fingerprint import fingerprint_of_files
    from wildshape.simulate.shapes.meshes import mesh_files

    known = {**asdict(config), "seed": settings.seed}
    if config.meshes is not None:
        files = mesh_files(config.meshes)
        known["mesh_files"] = fingerprint_of_files(files, config.meshes)
    return known


def _doubt(meshes: Path | None) -> None:
    """Say which axes of a LiDAR's meshes are odd: their scans would look sound."""
    from wildshape.cli.terminal import say
    from wildshape.simulate.shapes.meshes import doubt_of_axes

    if meshes is not None and (odd := doubt_of_axes(meshes)):
        say(odd)


def _tracks(settings: Settings) -> None:
    from wildshape.cli.terminal import TERMINAL, answer
    from wildshape.geometry.projection.full_scan import MOST_RAYS
    from wildshape.io.progress import counted, duration
    from wildshape.io.write_tracks import write_tracks
    from wildshape.simulate.generate import SimulationConfig, simulate_tracks

    began = time.monotonic()
    if settings.workers is not None and settings.workers < 1:
        raise BadInputError(f"--workers {settings.workers}: expected 1 or more.")
    config = SimulationConfig(
        tracks=settings.tracks,
        scans=settings.scans,
        sensor=settings.sensor,
        category=settings.category,
        meshes=settings.meshes,
        occlusion=settings.occlusion,
        ground=settings.ground,
        rays=MOST_RAYS if settings.rays else 0,
        varied=settings.varied,
    )
    _doubt(config.meshes if config.is_lidar else None)
    identity = _identity(config, settings)
    written = write_tracks(
        simulate_tracks(config, settings.seed, settings.workers),
        settings.out,
        settings.layout,
        command="simulate",
        settings=identity,
        overwrite=settings.overwrite,
        progress=TERMINAL,
        bar=("simulating", settings.tracks),
    )
    seconds = time.monotonic() - began
    text = (
        f"simulated {counted(written.tracks, 'track')}, {counted(written.scans, 'scan')},"
        f" {counted(written.points, 'point')} in {duration(seconds)}; see {settings.out}"
    )
    data = {"out": str(settings.out), **asdict(written), "seconds": round(seconds, 3)}
    answer(text, data, as_json=settings.json)
