# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a finished drive is written as beside its tables: boxes of data sets, meshes, recordings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from wildshape.arguments import check_fields
from wildshape.drives.completing.completion import CATEGORY
from wildshape.drives.writing.finished import FinishedDrive, read_finished
from wildshape.drives.writing.folder import MCAP, MESHES, RRD
from wildshape.drives.writing.playback.mcap import check_mcap, write_mcap
from wildshape.drives.writing.playback.rerun import load_rerun, write_rerun
from wildshape.geometry.meshing import closed_mesh
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.io.boxes.detections import Detection, frame_numbers, number_of
from wildshape.io.scans.writers import MeshFormat, write_mesh

_ROUNDED_NS = 1000  # more than what a float of seconds since 1970 loses


@dataclass(frozen=True)
class DriveFiles:
    """What to write of a drive; every one can be asked for later, too.

    Attributes:
        boxes: all boxes in formats of data sets, below `boxes/`.
        mesh: a closed mesh of each vehicle, in this format, below `meshes/`.
        mcap: `drive.mcap`, for Foxglove.
        rerun: `drive.rrd`, for Rerun.
    """

    boxes: BoxFiles | None = None
    mesh: MeshFormat | None = None
    mcap: bool = False
    rerun: bool = False

    def __post_init__(self) -> None:
        check_fields(self)

    def check(self) -> None:
        """Refuse before any work is done what could not be written after it.

        Raises:
            BadInputError: no such format, or a calibration that cannot be used.
            MissingExtraError: a library is not installed.
        """
        if self.boxes is not None:
            self.boxes.check()
        if self.mcap:
            check_mcap()
        if self.rerun:
            load_rerun()

    def write(self, out: Path) -> None:
        """Write what is asked for into the folder of a finished drive.

        Raises:
            BadInputError: the drive is damaged.
        """
        if self == DriveFiles():
            return
        found = read_finished(out)
        if self.boxes is not None:
            self.boxes.write_detections(found.out, list(detections_of(found)), found.name)
        if self.mesh is not None:
            for one in found.vehicles:
                path = found.out / MESHES / f"{one.name}.{self.mesh}"
                write_mesh(path, closed_mesh(found.shape(one)))
        if self.mcap:
            write_mcap(found, found.out / MCAP)
        if self.rerun:
            write_rerun(found, found.out / RRD)


def detections_of(found: FinishedDrive) -> Iterator[Detection]:
    """All boxes of a drive, for the formats of data sets."""
    times, numbers = found.times, frame_numbers(found.scan_names)
    for number, one in zip(_track_numbers(found), found.vehicles):
        velocities = found.velocities(one).tolist()
        for frame, box, points, (x, y, _) in zip(one.frames, one.boxes, one.points, velocities):
            scan = found.scan_names[frame]
            yield Detection(
                track=one.name,
                track_number=number,
                scan=scan,
                scan_number=numbers[frame],
                category=CATEGORY,
                sensor="lidar",
                score=one.confidence,
                box=box,
                sequence=found.name,
                time_ns=None if times is None else _time_ns(times[frame], scan),
                points=points,
                velocity=None if times is None else (round(x, 3), round(y, 3)),
            )


def _track_numbers(found: FinishedDrive) -> Sequence[int]:
    """What the vehicles' names count, as given tracks do, if all do; else their places."""
    numbers = [number_of(one.name, -1) for one in found.vehicles]
    told_apart = len(set(numbers)) == len(numbers) and -1 not in numbers
    return numbers if told_apart else range(len(numbers))


def _time_ns(seconds: float, scan: str) -> int:
    """A scan's time; its name, where that is its time, for a float of seconds is coarser."""
    time_ns = round(seconds * 1e9)
    named = scan.isascii() and scan.isdigit() and abs(int(scan) - time_ns) < _ROUNDED_NS
    return int(scan) if named else time_ns
