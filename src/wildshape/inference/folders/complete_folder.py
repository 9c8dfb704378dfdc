# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whole folders completed or registered, and what is written of each track (docs/formats.md).

`objects.json` is written last: a track folder that has it is finished. Parts of tracks are
completed at once: results do not depend on who works on what.
"""

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from wildshape.arguments import as_path, check_fields, expect
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.confidence import ReasonCounts
from wildshape.inference.folders.box_files import BOX_FILES, BoxFiles
from wildshape.inference.predictor import BATCH, Predictor, load
from wildshape.inference.registration import to_middle
from wildshape.io.atomic import write_json
from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.guard import reading
from wildshape.io.inputs import Part, TrackSource, open_tracks, with_rays
from wildshape.io.output import Output, begin, file_name, keep_apart, remove_leftovers
from wildshape.io.poses import times_of, write_poses, write_trajectory, write_tum
from wildshape.io.progress import SILENT, Bar, Progress
from wildshape.io.scans.points import SENSOR_METRES, Coordinates, checksum_of
from wildshape.io.scans.writers import (
    CLOUD_FORMATS,
    MESH_FORMATS,
    CloudFormat,
    MeshFiles,
    write_cloud,
    write_mesh,
)
from wildshape.method.checkpoint import fingerprint, weights_file
from wildshape.parallel.team import team
from wildshape.records import Completion, Track

COMPLETED, MESH, OBJECTS, POSES = "completed", "mesh", "objects.json", "poses.txt"
MIDDLE, TUM, TRAJECTORY = "T_middle_scan.txt", "trajectory.tum", "trajectory.json"
FILES = (
    *(f"*/{COMPLETED}/*.{kind}" for kind in CLOUD_FORMATS),
    *(f"*/{MESH}/*.{kind}" for kind in MESH_FORMATS),
    *(f"*/{name}" for name in (POSES, MIDDLE, TUM, TRAJECTORY, OBJECTS)),
    *BOX_FILES,
)
_MODEL = ("command", "code", "time_utc", "steps", "seed")  # said of a model


@dataclass(frozen=True)
class FolderOptions:
    """How a folder is completed or registered.

    Attributes:
        model: checkpoint, None for the shipped one.
        device: `auto`, `cpu` or `cuda`.
        coordinates: of the files that are read.
        rays: of the one scan that is completed, if they lie elsewhere than in its track's folder.
        track: use all scans of a track together.
        clouds: format of the shapes.
        mesh: also write a closed mesh of each shape, in this way.
        boxes: also write all boxes, in these files.
        workers: processes; None: one a core.
        ray: address of a Ray cluster in place of this machine, if any.
        overwrite: replace an earlier output.
    """

    model: Path | None = None
    device: str = "auto"
    coordinates: Coordinates = SENSOR_METRES
    rays: Path | None = None
    track: bool = False
    clouds: CloudFormat = "ply"
    mesh: MeshFiles | None = None
    boxes: BoxFiles | None = None
    workers: int | None = None
    ray: str | None = None
    overwrite: bool = False

    def __post_init__(self) -> None:
        check_fields(self)

    def identity(self, source: Path) -> dict[str, Any]:
        """What decides the output's content, as JSON values."""
        found = {"input": str(source.resolve()), **asdict(self.coordinates)}
        found["model"] = fingerprint(self.model)
        if source.is_dir():  # one scan is completed again
            found["files"] = fingerprint_of(source)
        uses = {"uses": "track"} if self.track else {}
        uses |= {"rays": str(self.rays.resolve())} if self.rays else {}
        clouds = {} if self.clouds == "ply" else {"clouds": self.clouds}
        mesh = {"mesh": self.mesh.kind} if self.mesh else {}
        colours = {"mesh_colours": "confidence"} if self.mesh and self.mesh.coloured else {}
        boxes = self.boxes.identity() if self.boxes else {}
        return {**found, **uses, **clouds, **mesh, **colours, **boxes}


@dataclass
class FolderSummary:
    """What was done.

    Attributes:
        out: the folder written.
        done: the verb: `completed` or `registered`.
        tracks, scans: written now.
        finished_before: tracks of an earlier, interrupted run.
        seconds, workers: that it took.
        skipped: what could not be used, with the reason.
        doubts: a sentence on each thing that is odd about the scans.
        reasons: which scans' results are not to be trusted.
    """

    out: Path
    done: str
    tracks: int = 0
    finished_before: int = 0
    scans: int = 0
    seconds: float = 0.0
    workers: int = 1
    skipped: list[tuple[str, str]] = field(default_factory=list)
    doubts: tuple[str, ...] = ()
    reasons: ReasonCounts = field(default_factory=ReasonCounts)


_DEFAULT = FolderOptions()


def complete_folder(
    source: Path | str,
    out: Path | str,
    options: FolderOptions = _DEFAULT,
    progress: Progress = SILENT,
    *,
    registers: bool = False,
) -> FolderSummary:
    """Complete every scan of every track, and write it; an interrupted run is gone on with.

    Args:
        source: a scan, TRACK, DATASET or packed store.
        out: folder to write.
        options: how.
        progress: is told what goes on.
        registers: also write the scans' poses to the middle scan, and trajectories.

    Raises:
        BadInputError: input, model or output cannot be used.
        MissingExtraError: a box file needs a library that is not installed.
    """
    began = time.monotonic()
    source, out = as_path(source, "source"), as_path(out, "out")
    expect(options, FolderOptions, "options")
    if options.boxes is not None:
        options.boxes.check()
    tracks = open_tracks(source, options.coordinates)
    if options.rays is not None:
        tracks = with_rays(tracks, options.rays, options.coordinates)
    predictor = load(options.model, options.device)
    keep_apart(out, source, weights_file(options.model), options.rays)
    command, identity = "register" if registers else "complete", options.identity(source)
    output = begin(out, command, identity, FILES, overwrite=options.overwrite, progress=progress)
    with output.abandoned_if_refused():
        found = write_results(
            tracks, predictor, output, options, registers=registers, progress=progress
        )
    if options.boxes is not None:
        for note in options.boxes.write(out):
            progress.say(note)
    output.finish(skipped=found.skipped)
    found.seconds = time.monotonic() - began
    return found


def write_results(
    source: TrackSource,
    predictor: Predictor,
    output: Output,
    options: FolderOptions = _DEFAULT,
    *,
    registers: bool = False,
    progress: Progress = SILENT,
) -> FolderSummary:
    """Complete every scan of every track and write the results.

    Args:
        source: the tracks.
        predictor: does the work.
        output: the folder, begun.
        options: all but the model and the box files count here.
        registers: see `complete_folder`.
        progress: is told what goes on.

    Raises:
        BadInputError: nothing can be used, or a name cannot be that of a file.
    """
    earlier: list[tuple[str, str]] = []
    sums: list[int] = []  # of the scans that are under way, in order
    summary = FolderSummary(output.path, "registered" if registers else "completed")
    for name in source.names:
        file_name(name)  # before any work

    def done(name: str) -> bool:
        before = _written_before(output.path / file_name(name) / OBJECTS)
        if before is None or source.path.is_file():  # it, or its rays, may be others by now
            return False
        earlier.extend((f"{name}/{scan}", reason) for scan, reason in before)
        summary.finished_before += 1
        return True

    def summed(part: Part) -> Part:
        sums.extend(map(checksum_of, part.track.scans))
        return part

    task = _PartCompleter(
        predictor,
        output.path.absolute(),
        together=options.track,
        clouds=options.clouds,
        mesh=options.mesh,
    )
    parts = map(summed, source.parts(None if options.track else BATCH, done))
    with (
        team(options.workers, options.ray) as helpers,
        progress.bar("completing", len(source)) as bar,
    ):
        for track, scans in _whole_tracks(helpers.in_order(task, parts), bar):
            folder = output.path / file_name(track.name)
            poses = stack([one.pose for one in scans])
            skipped = source.skipped_in(track.name)
            _write_poses(folder, track, poses, skipped, registers=registers)
            described = objects_of(
                track, scans, predictor, source.path, together=options.track, skipped=skipped
            )
            for entry in described["scans"]:
                entry["points_crc32"] = sums.pop(0)
            remove_leftovers(folder)  # of a worker that was killed, whose part another did
            write_json(folder / OBJECTS, described)
            summary.tracks, summary.scans = summary.tracks + 1, summary.scans + len(scans)
            summary.reasons.of((f"{track.name}/{name}" for name in track.scan_names), scans)
        summary.workers = helpers.worked
    summary.skipped, summary.doubts = [*earlier, *source.skipped], source.doubts
    return summary


@dataclass(frozen=True)
class _PartCompleter:
    """Completes a part and writes its shapes and meshes.

    Attributes:
        out: a folder of each track is written there.
        together: use all scans of a track together.
        clouds: format of the shapes.
        mesh: also write a closed mesh of each shape, in this way.
    """

    predictor: Predictor
    out: Path
    together: bool
    clouds: CloudFormat
    mesh: MeshFiles | None

    def __call__(self, part: Part) -> tuple[Part, list[Completion]]:
        """Complete and write the scans of a part; returns both without points."""
        track = part.track
        done = self.predictor.complete_checked(
            track.scans, track.sensor, track=self.together, rays=track.rays
        )
        bare, folder = [], self.out / file_name(track.name)
        for scan_name, scan, one in zip(track.scan_names, track.scans, done):
            name = file_name(scan_name)
            write_cloud(folder / COMPLETED / f"{name}.{self.clouds}", one.points)
            if self.mesh is not None:
                seen = scan if self.mesh.coloured else None
                write_mesh(folder / MESH / f"{name}.{self.mesh.kind}", one.mesh(seen))
            bare.append(replace(one, points=one.points[:0].copy()))
        return replace(part, track=replace(track, scans=(), rays=())), bare


def _whole_tracks(
    parts: Iterable[tuple[Part, list[Completion]]], bar: Bar
) -> Iterator[tuple[Track, list[Completion]]]:
    """The tracks, put together again from parts in order; `bar` is told how many are done."""
    names: list[str] = []
    found: list[Completion] = []
    for part, done in parts:
        names += part.track.scan_names
        found += done
        if part.end < part.count:
            bar.at(part.index, f"{part.track.name}, scan {part.end} of {part.count}")
            continue
        yield replace(part.track, scan_names=tuple(names)), found
        bar.at(part.index + 1, part.track.name)
        names, found = [], []


def _written_before(path: Path) -> list[tuple[str, str]] | None:
    """What an earlier run skipped of a track that it finished; None if it did not."""
    if not path.is_file():
        return None
    with reading(path, "what an earlier run wrote"):
        skipped = json.loads(path.read_text("utf-8"))["skipped"]
        return [(str(scan["scan"]), str(scan["reason"])) for scan in skipped]


def _write_poses(
    folder: Path, track: Track, poses: SE3, skipped: Sequence[tuple[str, str]], *, registers: bool
) -> None:
    write_poses(folder / POSES, poses)
    if registers:
        write_poses(folder / MIDDLE, to_middle(poses))
        without = [name for name, _ in skipped]
        write_tum(folder / TUM, poses, times_of(track.scan_names, without))
        write_trajectory(folder / TRAJECTORY, poses, track.scan_names, without)


def objects_of(
    track: Track,
    done: Sequence[Completion],
    predictor: Predictor,
    source: Path,
    *,
    together: bool,
    skipped: Sequence[tuple[str, str]] = (),
) -> dict[str, Any]:
    """What `objects.json` holds; `skipped`: names of scans and why they could not be used."""
    return {
        "format": 1,
        "track": track.name,
        "input": str(source.resolve()),
        "uses": "track" if together else "scan",
        "together": together,
        "category": track.category,
        "sensor": track.sensor.kind,
        "model": {name: predictor.settings.provenance.get(name) for name in _MODEL},
        "inference": asdict(predictor.config),
        "scans": [describe(name, one) for name, one in zip(track.scan_names, done)],
        "skipped": [{"scan": scan, "reason": reason} for scan, reason in skipped],
    }


def describe(name: str, done: Completion) -> dict[str, Any]:
    """A completed scan without its points; metres, the scan's sensor frame."""
    return {
        "scan": name,
        "box": asdict(done.box),
        "confidence": done.confidence,
        "p_pose": done.p_pose,
        "p_box": done.p_box,
        "p_kind": done.p_kind,
        "refined": done.refined,
        "seconds": done.seconds,
        "branch": done.branch,
        "cost_m": done.cost,
        "warning": done.warning,
        "reasons": done.reasons,
    }
