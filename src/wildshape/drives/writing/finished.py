# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A finished drive, read back from its folder: what other formats, pages and viewers are made of.

The level world is the sensor frame of the first frame with z vertical (`level_frame.py`).
"""

import csv
import math
from collections import defaultdict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int

from wildshape.arguments import as_path
from wildshape.drives.completing.level_frame import boxes_in_scans, level_poses
from wildshape.drives.completing.rolling_shutter import TURNS, Turns
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.source import Drive
from wildshape.drives.tracking.mounting import Mounting
from wildshape.drives.writing.folder import (
    BOXES,
    FRAMES,
    SHAPES,
    TRACKS,
    TRAJECTORY,
    TUM,
    is_drive,
)
from wildshape.errors import BadInputError
from wildshape.geometry.footprint import upright_places
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.bags.storages import STORAGES
from wildshape.io.boxes.detections import poses_of
from wildshape.io.boxes.table import BoxRow, read_box_table
from wildshape.io.guard import read_json, read_record, reading
from wildshape.io.output import MARKER, file_name
from wildshape.io.packets.reader import SUFFIXES
from wildshape.io.poses import read_poses, read_tum
from wildshape.io.scans.points import read_points
from wildshape.records import Box, Points, as_text

_LATEST_S = 9e9  # nanoseconds of it fit into 64 bits
_BEHIND = 0.49  # of a turn before or after its middle: it may be the turn's end or its beginning
_FAR_APART = 20.0  # half steps from scan to scan: ten turns, of which one is a tenth
_FILES = (*STORAGES, *SUFFIXES)  # recordings that are one
_PERIOD_S = 0.1  # of a scan, where no times are known


@dataclass(frozen=True)
class FoundVehicle:
    """A vehicle in all frames from the first to the last in which it was seen.

    Attributes:
        name: that of its folders.
        size: length, width, height, metres.
        confidence: that it is a vehicle, 0 to 1.
        moving: or standing.
        frames: rising.
        boxes: in each frame's sensor frame.
        points: of each frame's scan that belong to it.
    """

    name: str
    size: tuple[float, float, float]
    confidence: float
    moving: bool
    frames: tuple[int, ...]
    boxes: tuple[Box, ...]
    points: tuple[int, ...]

    @property
    def fullest(self) -> int:
        """The frame of most points."""
        return self.frames[int(np.argmax(self.points))]

    @property
    def nearest_m(self) -> float:
        """The least distance from the sensor to its middle, metres."""
        return min(math.dist((0.0, 0.0, 0.0), box.centre) for box in self.boxes)


@dataclass(frozen=True)
class FinishedDrive:
    """What `wildshape drive` left in a folder.

    Attributes:
        scan_names: one a frame.
        times: seconds, if known.
        ticks: when each scan was taken, counted in scans, if times are not known.
        scanned: points of each scan.
        T_level_sensor: from each frame's sensor frame to the level world.
        ground_m: height of the sensor above the ground.
        vehicles: by name.
        record: what `wildshape.json` holds.
    """

    out: Path
    scan_names: tuple[str, ...]
    times: tuple[float, ...] | None
    ticks: tuple[float, ...]
    scanned: tuple[int, ...]
    T_level_sensor: SE3
    turns: Turns
    ground_m: float
    vehicles: tuple[FoundVehicle, ...]
    record: dict[str, Any]

    def __len__(self) -> int:
        return len(self.scan_names)

    @property
    def source(self) -> Path:
        """Where the scans were."""
        return Path(self.record["settings"]["source"])

    @property
    def name(self) -> str:
        """Of the recording."""
        is_file = self.source.suffix.lower() in _FILES  # it may be gone; folders may have dots
        return as_text(self.source.stem if is_file else self.source.name)

    @property
    def seconds(self) -> tuple[float, ...]:
        """Since the first scan; ten scans a second where no times are known."""
        at = self.times or tuple(_PERIOD_S * tick for tick in self.ticks)
        return tuple(time - at[0] for time in at)

    @property
    def travelled_m(self) -> float:
        """Length of the sensor's way."""
        places = self.T_level_sensor.translation.numpy()
        return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())

    def open_source(self, moved: Path | None = None) -> Drive:
        """The recording, to read its scans again as they were cut; `moved`: where it is now.

        Raises:
            BadInputError: it is not there, or has another number of scans.
        """
        source = moved or self.source
        drive = open_drive(source, self.record["settings"].get("topic"))
        if len(drive) != len(self):
            raise BadInputError(
                f"{source}: {len(drive)} scans, and {self.out} was made of {len(self)}; name the"
                " recording it was made of."
            )
        return drive.moved_by(self.T_level_sensor)

    def check_current(self) -> None:
        """Refuse a folder that holds another drive by now: a vehicle of this name is another one.

        Raises:
            BadInputError: it was written anew, or has gone.
        """
        if _read_record(self.out / MARKER) != self.record:
            raise BadInputError(f"{self.out}: was written anew since; start the viewer again.")

    def shape(self, vehicle: FoundVehicle) -> Points:
        """`(n, 3)` complete shape, metres, in its box's frame: x forward, origin in the middle.

        Raises:
            BadInputError: the file is damaged.
        """
        return read_points(self.out / SHAPES / f"{vehicle.name}.ply")

    def scan(self, vehicle: FoundVehicle, name: str) -> Points:
        """`(n, 3)` a vehicle's scan of a frame as measured, sensor frame; none if it is lost."""
        try:
            return read_points(self.out / TRACKS / vehicle.name / "scans" / f"{name}.ply")
        except BadInputError:
            return np.empty((0, 3), np.float32)

    def speeds(self, vehicle: FoundVehicle) -> list[float] | None:
        """Over the ground, of each of its frames, m/s; None where no times are known."""
        if self.times is None:
            return None
        return np.linalg.norm(self.velocities(vehicle), axis=1).tolist()

    def velocities(self, vehicle: FoundVehicle) -> Float[np.ndarray, "f 3"]:
        """Over the ground, in each frame's sensor axes, m/s; 0 for what stands.

        Of where the vehicle stood when the beam met it, and when that was.
        """
        frames = np.array(vehicle.frames)
        if not vehicle.moving or len(frames) < 2:
            return np.zeros((len(frames), 3))
        met, phase = self.turns.met(frames, upright_places(self.placed(vehicle)))
        at = np.array(self.seconds)[frames] + phase * self._turn_s
        rates = _rates(met[:, :3], at, np.abs(phase) < _BEHIND)
        turns = self.T_level_sensor.rotation.numpy()[frames]
        return np.einsum("fij,fi->fj", turns, rates)

    @property
    def _turn_s(self) -> float:
        """How long a turn takes, of a drive of several."""
        return self.seconds[-1] / max(self.turns.ticks[-1] - self.turns.ticks[0], 1)

    def placed(self, vehicle: FoundVehicle) -> SE3:
        """`(f,)` `T_level_box`, one of each of a vehicle's frames."""
        return self.T_level_sensor[torch.tensor(vehicle.frames)] @ poses_of(vehicle.boxes)


def _rates(
    places: Float[np.ndarray, "k 3"], at: Float[np.ndarray, "k"], sure: Bool[np.ndarray, "k"]
) -> Float[np.ndarray, "k 3"]:
    """Velocity at each time, from the sure places around it.

    A beam may meet a thing at the end of a turn and again at once. Where no sure place follows, or
    none came before, a turn more or less must not count: all places so far apart are asked.
    """
    apart = np.median(np.diff(np.sort(at))) / 2
    rates = _across(places, at, np.arange(len(at)), _FAR_APART * apart)
    rows = np.flatnonzero(sure)
    if len(rows) > 1:
        among = (at >= at[rows].min()) & (at <= at[rows].max())
        rates[among] = _across(places, at, rows, apart)[among]
    return rates


def _across(
    places: Float[np.ndarray, "k 3"],
    at: Float[np.ndarray, "k"],
    rows: Int[np.ndarray, "r"],
    apart: float,
) -> Float[np.ndarray, "k 3"]:
    """Velocity at each time between places of some rows, before and after it by so much."""
    order = rows[np.argsort(at[rows])]
    rising = at[order]
    before = np.maximum(np.searchsorted(rising, at - apart, "right") - 1, 0)
    after = np.minimum(np.searchsorted(rising, at + apart, "left"), len(rising) - 1)
    since = (rising[after] - rising[before])[:, None]
    way = places[order[after]] - places[order[before]]
    return np.divide(way, since, out=np.zeros_like(way), where=since > 0)


def read_finished(out: Path | str, boxes_in: Path | str | None = None) -> FinishedDrive:
    """What `wildshape drive` left in a folder; `boxes_in`: another than it, with its boxes.

    Raises:
        BadInputError: no drive, or a damaged one.
    """
    out = as_path(out, "out")
    if not is_drive(out):
        raise BadInputError(f"{out}: holds no finished drive; run `wildshape drive` with --out.")
    names, times, scanned = _read_frames(out / FRAMES)
    mounting = read_record(out / "stages" / "mounting.json", "the sensor's mounting", Mounting)
    T_level_sensor = level_poses(read_poses(out / TRAJECTORY, len(names)), mounting)
    ticks, _ = read_tum(out / TUM)
    for path, at in ((out / FRAMES, times or ()), (out / TUM, ticks)):
        rising = all(before < after for before, after in pairwise(at))
        if not rising or not all(abs(time) < _LATEST_S for time in at):
            raise BadInputError(f"{path}: its times do not rise, or are none; write it anew.")
    if len(ticks) != len(names):
        raise BadInputError(
            f"{out / TUM}: {len(ticks)} poses for {len(names)} scans; write it anew."
        )
    rows: dict[str, list[BoxRow]] = defaultdict(list)
    table = as_path(boxes_in or out, "boxes_in") / BOXES
    for row in read_box_table(table):
        if not 0 <= row.frame < len(names):
            raise BadInputError(f"{table}: frame {row.frame} of {len(names)}; write it anew.")
        file_name(row.track)
        if any(row.frame <= one.frame for one in rows[row.track][-1:]):
            raise BadInputError(
                f"{table}: the frames of track '{row.track}' do not rise; write it anew."
            )
        rows[row.track].append(row)
    return FinishedDrive(
        out=out,
        scan_names=names,
        times=times,
        ticks=tuple(ticks),
        scanned=scanned,
        T_level_sensor=T_level_sensor,
        turns=Turns.read(out / "stages" / TURNS, T_level_sensor),
        ground_m=mounting.height_m,
        vehicles=tuple(_vehicle(rows[name], T_level_sensor) for name in sorted(rows)),
        record=_read_record(out / MARKER),
    )


def _read_record(path: Path) -> dict[str, Any]:
    with reading(path, "what `wildshape drive` says of itself"):
        record = read_json(path, "what `wildshape drive` says of itself")
        source, topic = (record["settings"].get(name) for name in ("source", "topic"))
        if not isinstance(source, str) or not isinstance(topic, str | None):
            raise ValueError(f"source {source!r}, topic {topic!r}")
        said = record.get("result") or {}
        seconds, warned = said.get("seconds") or {}, said.get("warnings") or []
        timed = all(isinstance(spent, int | float) for spent in seconds.values())
        if not timed or not isinstance(warned, list):
            raise ValueError(f"seconds {seconds!r}, warnings {warned!r}")
        if not isinstance(made := record.get("provenance") or {}, dict):
            raise ValueError(f"provenance {made!r}")
        file_name(Path(source).name)
        return record


def _read_frames(
    path: Path,
) -> tuple[tuple[str, ...], tuple[float, ...] | None, tuple[int, ...]]:
    with reading(path, "a list of frames"), path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
        times = [row["time"] for row in rows]
        names = tuple(row["scan"] for row in rows)
        points = tuple(int(row["points"]) for row in rows)
        seconds = tuple(map(float, times)) if any(times) else None
    return names, seconds, points


def _vehicle(rows: list[BoxRow], T_level_sensor: SE3) -> FoundVehicle:
    first = rows[0]
    return FoundVehicle(
        name=first.track,
        size=(first.length, first.width, first.height),
        confidence=first.confidence,
        moving=first.moving,
        frames=tuple(row.frame for row in rows),
        boxes=tuple(_upright(rows, T_level_sensor)),
        points=tuple(row.points for row in rows),
    )


def _upright(rows: list[BoxRow], T_level_sensor: SE3) -> list[Box]:
    """The boxes of lines, upright in the level world, each in its frame's sensor frame."""
    T = T_level_sensor[torch.tensor([row.frame for row in rows])]
    x, y, z = T.rotation.numpy()[:, 2].T
    yaw = np.array([row.yaw for row in rows])
    c, s = np.cos(yaw), np.sin(yaw)
    level = np.stack((c, s, -(x * c + y * s) / z), axis=1)  # and along the yaw as the sensor sees
    ahead = np.einsum("kij,kj->ki", T.rotation.numpy(), level)
    places = T.apply(torch.tensor([[(row.x, row.y, row.z)] for row in rows]).double())[:, 0]
    upright = np.column_stack((places.numpy(), np.arctan2(ahead[:, 1], ahead[:, 0])))
    first = rows[0]
    return boxes_in_scans(upright, (first.length, first.width, first.height), T)
