# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape drive`: every vehicle of a raw recording, without labels."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import FlagCreatePairsOff, Positional, arg

from wildshape.cli.commands import uncollected
from wildshape.cli.options import (
    DEFAULT_NETWORK,
    DEFAULT_WORK,
    AsJson,
    Boxes,
    Network,
    OutFolder,
    Overwrite,
    Work,
    check_mesh_format,
    option,
)
from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.drives.adapting.adapt import Adaptation
    from wildshape.drives.adapting.config import AdaptConfig
    from wildshape.drives.result import DriveResult
    from wildshape.drives.tracking.detections import DetectionFile
    from wildshape.drives.writing.files import DriveFiles
    from wildshape.inference.folders.box_files import BoxFiles
    from wildshape.parallel.team import Team
    from wildshape.report.drive.many import DriveAndPage, DrivesResult

EXAMPLES = (
    "wildshape drive recording --out found",
    "wildshape drive 2011_09_26_drive_0048_sync --out found",
    "wildshape drive recording --out found --boxes json,kitti --mesh --mcap",
    "wildshape drive recording.bag --out found --topic /velodyne_points",
    "wildshape drive recording --out found --detections results.json",
    "wildshape drive monday tuesday --out found",
    "wildshape drive nuscenes/scene-0061 --out found",
    "wildshape drive monday tuesday --out found --adapt",
)

Sources = Annotated[
    tuple[Path, ...],
    Positional,
    option(
        metavar="SOURCE",
        help="folder of full scans, sorted by name (with times.txt or poses.txt if there are),"
        " recording of ROS with PointCloud2 (folder of ROS 2 with .db3 or .mcap, or .bag of ROS 1),"
        " packets of Velodyne or Ouster (.pcap), or folder of KITTI, nuScenes, Argoverse 2, Waymo"
        " or PandaSet (all its drives, or one: nuscenes/scene-0061)",
    ),
]


@dataclass(frozen=True)
class Settings:
    """Find every vehicle of a raw recording: its track, boxes and complete shape, without labels.

    Writes DIR/boxes.csv (a line per vehicle and frame, in that frame's sensor frame),
    trajectory.txt (T_world_sensor), tracks/ (input for every other command), objects/ and shapes/
    (completed shapes) and report.html (the drive over time, in 3D); of several drives each into a
    folder of its name. Repeat the command to continue a stopped run, or to add files to a finished
    one.
    """

    source: Sources
    out: OutFolder
    topic: Annotated[
        str | None, option(metavar="NAME", help="of the point clouds, if a recording has several")
    ] = None
    network: Network = DEFAULT_NETWORK
    work: Work = DEFAULT_WORK
    boxes: Boxes = ()
    calibration: Annotated[
        Path | None,
        option(
            metavar="FILE",
            help="KITTI's (.txt) or Argoverse 2's (.feather), for --boxes and --detections",
        ),
    ] = None
    mesh: Annotated[bool, arg(help="also write a closed mesh of each vehicle")] = False
    mesh_format: Annotated[Literal["ply", "obj", "glb"], arg(help="of the meshes")] = "ply"
    mcap: Annotated[
        bool, arg(help="also write DIR/drive.mcap, to play in Foxglove (extra `mcap`)")
    ] = False
    rerun: Annotated[
        bool, arg(help="also write DIR/drive.rrd, to play in Rerun (extra `rerun`)")
    ] = False
    rays: Annotated[
        bool, arg(help="also keep, in tracks/, the rays around each vehicle that did not hit it")
    ] = False
    detections: Annotated[
        Path | None,
        option(
            metavar="FILE",
            help="boxes of your own detector in place of our clusters: labels of KITTI (a tracking"
            " file, or a folder with a file per scan), results of nuScenes (in the sensor frame),"
            " OpenPCDet or mmdetection3d as .json, or a boxes.csv; tracks are kept if every box"
            " has one",
        ),
    ] = None
    min_score: Annotated[
        float | None,
        option(metavar="S", help="detections of a lower score are left out"),
    ] = None
    adapt: Annotated[
        bool,
        arg(
            help="train the model on the vehicles found, without labels, and complete them again if"
            " it is better on some that it was not trained on"
        ),
    ] = False
    adapt_steps: Annotated[
        int | None, option(metavar="N", help="steps of that training, by default 300: minutes")
    ] = None
    no_report: Annotated[FlagCreatePairsOff[bool], arg(help="write no report.html")] = False
    overwrite: Overwrite = False
    json: AsJson = False


def run(settings: Settings) -> None:
    """Find the vehicles of every drive.

    Raises:
        BadInputError: a source, the model or the output cannot be used.
        MissingExtraError: a library is not installed.
    """
    from wildshape.io.atomic import released_after
    from wildshape.parallel.team import team

    work = settings.work
    if work.ray is not None:
        _run(settings, work.workers)
        return
    # A helper imports what it needs while this process does.
    soon = "wildshape.drives.pipeline"
    with released_after(settings.out), team(work.workers, soon=soon) as helpers:
        _run(settings, helpers)


def _run(settings: Settings, workers: "int | Team | None") -> None:
    with uncollected():
        from wildshape.cli.terminal import say, stage_bars
        from wildshape.drives.config import INFERENCE, DriveConfig
        from wildshape.drives.writing.files import DriveFiles
        from wildshape.inference.predictor import load
        from wildshape.report.drive.many import DriveAndPage

    adapt, files = _adapt(settings), _files(settings)
    drives = _drives(settings)
    folders = _folders(settings, list(drives))
    detections = _detections(settings, drives)
    files.check()
    task = DriveAndPage(
        predictor=load(settings.network.model, settings.network.device, config=INFERENCE),
        topic=settings.topic,
        config=DriveConfig(rays=settings.rays),
        files=files,
        detections=detections,
        report=not settings.no_report,
        workers=workers,
        overwrite=settings.overwrite,
    )
    several = len(folders) > 1 or settings.work.ray is not None
    if several:
        say("\n".join(filter(None, drives.values())))
    find = _many if several else _one
    change: Adaptation | None = None
    if adapt is not None:
        from wildshape.drives.adapting.adapt import adapt_to

        first = find(replace(task, files=DriveFiles(), report=False), folders, drives, settings)
        if first.refused:  # an adaptation of the others would stand in the way of all
            _answer(first, None, settings, several=several)
        outs = [found.out for found in first.found]
        with stage_bars() as watch:
            change = adapt_to(
                outs, settings.out, task.predictor, adapt, overwrite=task.overwrite, watch=watch
            )
        task = replace(task, adapt=change, overwrite=False)
        drives = dict.fromkeys(drives, "")  # said already
    _answer(find(task, folders, drives, settings), change, settings, several=several)


def _adapt(settings: Settings) -> "AdaptConfig | None":
    from wildshape.drives.adapting.config import AdaptConfig

    if not settings.adapt:
        if settings.adapt_steps is not None:
            raise BadInputError("--adapt-steps is of an adaptation; pass --adapt, too.")
        return None
    return AdaptConfig() if settings.adapt_steps is None else AdaptConfig(settings.adapt_steps)


def _one(
    task: "DriveAndPage", folders: dict[Path, Path], drives: dict[Path, str], settings: Settings
) -> "DrivesResult":
    from wildshape.cli.terminal import stage_bars
    from wildshape.report.drive.many import DrivesResult

    del settings
    ((source, out),) = folders.items()
    with stage_bars(drives[source]) as watch:
        found = task.find(source, out, watch)
    return DrivesResult([found], {}, found.workers)


def _many(
    task: "DriveAndPage", folders: dict[Path, Path], drives: dict[Path, str], settings: Settings
) -> "DrivesResult":
    from wildshape.cli.terminal import TERMINAL
    from wildshape.report.drive.many import drive_many

    del drives
    work = settings.work
    return drive_many(task, folders, workers=work.workers, ray=work.ray, progress=TERMINAL)


def _answer(
    done: "DrivesResult", change: "Adaptation | None", settings: Settings, *, several: bool
) -> None:
    from wildshape.cli.terminal import answer
    from wildshape.io.progress import counted

    said = [] if change is None else [change.sentence]
    said += map(_sentence, done.found)
    found = [{**asdict(one), "out": str(one.out)} for one in done.found]
    data: dict[str, Any] = {"drives": found}
    if change is not None:
        data["adapted"] = change.data
    if several:
        said.append(f"{counted(len(done.found), 'drive')} with {counted(done.workers, 'worker')}")
        data["refused"] = [
            {"source": str(source), "reason": why} for source, why in done.refused.items()
        ]
        data["workers"] = done.workers
    answer("\n".join(said), data, as_json=settings.json)
    if done.refused:
        reasons = " ".join(done.refused.values())
        count = len(done.refused)
        raise BadInputError(f"{count} of {count + len(done.found)} drives not done: {reasons}")


def _files(settings: Settings) -> "DriveFiles":
    from wildshape.drives.writing.files import DriveFiles

    check_mesh_format(settings.mesh_format, mesh=settings.mesh)
    mesh = settings.mesh_format if settings.mesh else None
    return DriveFiles(_box_files(settings), mesh, mcap=settings.mcap, rerun=settings.rerun)


def _box_files(settings: Settings) -> "BoxFiles | None":
    """The formats asked for; a calibration that is for the detections alone is not theirs."""
    from wildshape.inference.folders.box_files import BoxFiles

    files = BoxFiles(settings.boxes, settings.calibration)
    given = settings.calibration
    kitti = given is not None and given.suffix.lower() == ".txt"
    if settings.detections is not None and kitti and not files.uses_calibration:
        files = BoxFiles(settings.boxes)
    return files if files.formats or files.calibration else None


def _detections(settings: Settings, drives: dict[Path, str]) -> "DetectionFile | None":
    from wildshape.drives.tracking.detections import DetectionFile

    if settings.detections is None:
        if settings.min_score is not None:
            raise BadInputError("--min-score is of detections; name them with --detections.")
        return None
    if len(drives) > 1 or len(settings.source) > 1:
        taken_for = ", ".join(text for text in drives.values() if text)
        raise BadInputError(
            f"--detections {settings.detections}: give one drive with them; {taken_for}."
        )
    known = settings.calibration
    kitti = known if known is not None and known.suffix.lower() == ".txt" else None
    return DetectionFile(settings.detections, kitti, settings.min_score)


def _drives(settings: Settings) -> dict[Path, str]:
    """The drives of all sources; with the first of each, what the source was taken for."""
    from wildshape.drives.recordings.recording_kinds import find_drives
    from wildshape.io.progress import counted

    if not settings.source:
        raise BadInputError("drive needs a SOURCE: a folder of full scans.")
    drives: dict[Path, str] = {}
    for source in settings.source:
        found = find_drives(source)
        several = f"{counted(len(found.drives), 'drive')} of " if len(found.drives) > 1 else ""
        drives |= dict.fromkeys(found.drives, "")
        drives[found.drives[0]] = f"{source}: taken for {several}{found.what}"
    return drives


def _folders(settings: Settings, drives: list[Path]) -> dict[Path, Path]:
    """Where each drive goes."""
    from wildshape.drives.adapting.adapt import ADAPTED
    from wildshape.drives.recordings.recording_kinds import names_of
    from wildshape.io.output import is_output

    if len(drives) == 1:
        return {drives[0]: settings.out}
    if is_output(settings.out):
        raise BadInputError(
            f"{settings.out}: holds an output already; several drives go into folders of their"
            " own, so choose another --out."
        )
    found = {drive: settings.out / name for drive, name in zip(drives, names_of(drives))}
    for drive, folder in found.items():
        if settings.adapt and folder.name == ADAPTED:
            raise BadInputError(
                f"{drive}: its folder would be {folder}, where the adaptation goes; rename it."
            )
    return found


def _sentence(found: "DriveResult") -> str:
    from wildshape.cli.terminal import say
    from wildshape.drives.result import REPORT
    from wildshape.io.progress import counted, duration

    for warning in found.warnings:
        say(f"{found.out.name}: {warning}")
    page = found.out / REPORT
    vehicles = counted(len(found.vehicles), "vehicle")
    return (
        f"found {vehicles}, {found.moving} of them moving, in {counted(found.frames, 'scan')}"
        f" in {duration(sum(found.seconds.values()))} with {counted(found.workers, 'worker')};"
        f" see {page if page.is_file() else found.out}"
    )
