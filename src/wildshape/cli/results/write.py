# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What `complete` and `register` write of a track (docs/formats.md).

`objects.json` is written last: a track folder that has it is finished.
"""

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from wildshape.cli.input.tracks import Reading
from wildshape.cli.models import fingerprint, load_model
from wildshape.cli.options import Device
from wildshape.cli.output import Output, begin, keep_apart
from wildshape.cli.results.boxes import BOX_FILES, BoxOrder
from wildshape.cli.results.tally import Tally
from wildshape.cli.terminal import answer, counted, duration, progress, say, say_skipped
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import stack
from wildshape.inference.completed_files import COMPLETED, OBJECTS, POSES, file_name, objects_of
from wildshape.inference.predictor import Predictor
from wildshape.inference.registration import to_middle
from wildshape.io.atomic import write_json
from wildshape.io.guard import reading as reading_file
from wildshape.io.poses import times_of, write_trajectory, write_tum
from wildshape.io.scans.points import Coordinates, write_ply
from wildshape.io.scans.writers import MESH_FORMATS, MeshOrder, write_mesh
from wildshape.io.tracks import write_poses
from wildshape.records import Completion, Track

MIDDLE, MESH = "T_middle_scan.txt", "mesh"
TUM, TRAJECTORY = "trajectory.tum", "trajectory.json"
FILES = (
    f"*/{COMPLETED}/*.ply",
    *(f"*/{MESH}/*.{kind}" for kind in MESH_FORMATS),
    f"*/{POSES}",
    f"*/{MIDDLE}",
    f"*/{TUM}",
    f"*/{TRAJECTORY}",
    f"*/{OBJECTS}",
    *BOX_FILES,
)


@dataclass(frozen=True)
class Work:
    """One command's order.

    Attributes:
        command: `complete` writes clouds; `register` the scans' poses to the middle scan instead.
        input: what to read.
        out: folder to write.
        model: checkpoint, None for the shipped one.
        coordinates: of the files.
        device: `auto`, `cpu` or `cuda`.
        track: use all scans of a track together.
        mesh: also write a closed mesh of each shape, in this way.
        boxes: also write all boxes, in this way.
    """

    command: Literal["complete", "register"]
    input: Path
    out: Path
    model: Path | None
    coordinates: Coordinates
    device: Device
    track: bool = False
    mesh: MeshOrder | None = None
    boxes: BoxOrder = field(default_factory=BoxOrder)

    def identity(self) -> dict[str, Any]:
        """What decides the output's content."""
        source = str(self.input.resolve())
        found = {"input": source, **asdict(self.coordinates), "model": fingerprint(self.model)}
        uses = {"uses": "track"} if self.track else {}
        mesh = {"mesh": self.mesh.kind} if self.mesh else {}
        colours = {"mesh_colours": "confidence"} if self.mesh and self.mesh.coloured else {}
        return {**found, **uses, **mesh, **colours, **self.boxes.identity()}


def perform(work: Work, *, overwrite: bool, as_json: bool) -> None:
    """Do the work, say what was skipped, and answer.

    Raises:
        BadInputError: input, model or output cannot be used.
    """
    began = time.monotonic()
    reading = Reading(work.input, work.coordinates)
    predictor = load_model(work.model, work.device)
    keep_apart(work.input, work.out)
    output = begin(work.out, work.command, work.identity(), FILES, overwrite=overwrite)
    try:
        tally = write_results(
            reading,
            predictor,
            output,
            registers=work.command == "register",
            together=work.track,
            mesh=work.mesh,
        )
    except BadInputError:
        output.abandon()
        raise
    work.boxes.write(work.out)
    output.finish(skipped=tally.skipped)
    _conclude(work, tally, reading, time.monotonic() - began, as_json)


def _conclude(work: Work, tally: Tally, reading: Reading, seconds: float, as_json: bool) -> None:
    if reading.dropped:
        say(reading.dropped)
    say_skipped(tally.skipped)
    if tally.doubts.flagged:
        say(tally.doubts.sentence)
    done = "completed" if work.command == "complete" else "registered"
    before = f", {counted(tally.kept, 'track')} had been finished before" if tally.kept else ""
    text = (
        f"{done} {counted(tally.scans, 'scan')} of {counted(tally.tracks, 'track')}"
        f" in {duration(seconds)}{before};"
        f" see {work.out}"
    )
    data = {
        "out": str(work.out),
        "tracks": tally.tracks,
        "tracks_finished_before": tally.kept,
        "scans": tally.scans,
        "skipped": [{"what": what, "reason": reason} for what, reason in tally.skipped],
        **tally.doubts.data,
        "seconds": round(seconds, 3),
    }
    answer(text, data, as_json=as_json)


def write_results(
    reading: Reading,
    predictor: Predictor,
    output: Output,
    *,
    registers: bool = False,
    together: bool = False,
    mesh: MeshOrder | None = None,
) -> Tally:
    """Complete every scan of every track and write the results, track after track.

    Args:
        reading: the tracks.
        predictor: does the work.
        output: the folder, begun.
        registers: write `T_middle_scan` instead of the completed shapes.
        together: complete from all scans of a track, not from each on its own.
        mesh: also write a closed mesh of each shape, in this way.

    Raises:
        BadInputError: nothing can be used, or a name cannot be that of a file.
    """
    names = reading.source.names
    earlier: list[tuple[str, str]] = []
    tally = Tally()

    def done(name: str) -> bool:
        path = output.path / file_name(name) / OBJECTS
        if not path.is_file():
            return False
        with reading_file(path, "what an earlier run wrote"):
            found = json.loads(path.read_text("utf-8"))["skipped"]
            earlier.extend((f"{name}/{scan['scan']}", scan["reason"]) for scan in found)
        tally.kept += 1
        return True

    with progress("completing", len(names)) as bar:
        for index, track in reading.tracks(done):
            at = lambda text, index=index: bar.at(index, text)  # noqa: E731
            folder = output.path / file_name(track.name)
            scans = complete_track(
                track,
                predictor,
                folder,
                at,
                registers=registers,
                together=together,
                mesh=mesh,
            )
            described = objects_of(
                track,
                scans,
                predictor,
                reading.source.path,
                together=together,
                skipped=reading.skipped_in(track.name),
            )
            write_json(folder / OBJECTS, described)
            tally.add(track, scans)
            bar.at(index + 1, track.name)
    tally.skipped = [*earlier, *reading.skipped]
    return tally


def complete_track(
    track: Track,
    predictor: Predictor,
    folder: Path,
    at: Callable[[str], None] = lambda _: None,
    *,
    registers: bool = False,
    together: bool = False,
    mesh: MeshOrder | None = None,
) -> list[Completion]:
    """Complete the scans of a track, writing each into its folder; all but `objects.json`."""
    found: list[Completion] = []
    complete = predictor.complete_track if together else predictor.complete_many
    for done in complete(track.scans, track.sensor):
        name = file_name(track.scan_names[len(found)])
        if not registers:
            write_ply(folder / COMPLETED / f"{name}.ply", done.points)
        if mesh is not None:
            scan = track.scans[len(found)] if mesh.coloured else None
            write_mesh(folder / MESH / f"{name}.{mesh.kind}", done.mesh(scan))
        found.append(done)
        at(f"{track.name}, scan {len(found)} of {len(track.scans)}")
    poses = stack([done.pose for done in found])
    write_poses(folder / POSES, poses)
    if registers:
        write_poses(folder / MIDDLE, to_middle(poses))
        write_tum(folder / TUM, poses, times_of(track.scan_names))
        write_trajectory(folder / TRAJECTORY, poses, track.scan_names)
    return found
