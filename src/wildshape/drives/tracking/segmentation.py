# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Each scan of a drive cut: its ground taken away, what stands on it kept in a file a scan."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.config import DriveConfig
from wildshape.drives.frame_cache import FrameCache
from wildshape.drives.source import Drive
from wildshape.drives.tracking.ceiling import at_ceiling
from wildshape.drives.tracking.clusters import find_clusters
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.landmarks import Landmarks, landmarks
from wildshape.drives.tracking.mounting import Mounting
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.atomic import atomic_write
from wildshape.io.guard import reading
from wildshape.records import Points, Turn


@dataclass(frozen=True)
class CutScan:
    """The clusters of one scan.

    Attributes:
        points: of all clusters, one after the other, sensor frame, metres.
        rows: of each of them in the whole scan.
        counts: points of each cluster.
        scanned: points of the whole scan.
        tracks: the object that each cluster is, if known (`detections.py`).
        grounds: `(k, 3)` a point of the ground under each cluster, sensor frame, metres; none
            before it is written.
        seconds: when each of the points was met, since the scan's time; empty if not known.
    """

    points: Points
    rows: Int[np.ndarray, "n"]
    counts: Int[np.ndarray, "k"]
    scanned: int
    tracks: tuple[str, ...] = ()
    grounds: Float[np.ndarray, "_ 3"] = field(default_factory=lambda: np.empty((0, 3)))
    seconds: Float[np.ndarray, "_"] = field(default_factory=lambda: np.empty(0))

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return sum(a.nbytes for a in (self.points, self.rows, self.grounds, self.seconds))

    @cached_property
    def ends(self) -> list[int]:
        """Where each cluster ends."""
        return np.cumsum(self.counts).tolist()

    def moved(self, T_target_sensor: SE3) -> list[Points]:
        """The points of each cluster in another frame."""
        points = T_target_sensor.apply_numpy(self.points)
        return [points[self._of(row)] for row in range(len(self.counts))]

    def cluster(self, row: int) -> Points:
        """The points of one."""
        return self.points[self._of(row)]

    def seconds_of(self, row: int) -> Float[np.ndarray, "_"]:
        """When the points of one were met; empty if not known."""
        return self.seconds[self._of(row)]

    def rows_of(self, clusters: Sequence[int]) -> Int[np.ndarray, "k"]:
        """The rows of the points of some in the whole scan."""
        return np.concatenate([self.rows[self._of(row)] for row in clusters])

    def _of(self, row: int) -> slice:
        return slice(self.ends[row - 1] if row else 0, self.ends[row])


@dataclass(frozen=True)
class Cutter:
    """Cuts the scans of a drive.

    Attributes:
        drive: its scans are read one by one.
        folder: `000000.npz` of each frame is written there.
    """

    drive: Drive
    mounting: Mounting
    folder: Path
    config: DriveConfig

    def missing(self) -> list[int]:
        """The frames that have no file yet."""
        return [i for i in range(len(self.drive)) if not cut_file(self.folder, i).is_file()]

    def __call__(self, frame: int) -> None:
        """Cut one scan and write its file."""
        turn = self.drive.turn(frame)
        scan = self.drive.corrected(frame, turn)
        self._write(frame, scan, self._heights(scan), turn)

    def landmarks(self, frame: int) -> Landmarks:
        """What odometry sees of a frame, which is cut on the way.

        One whose points have times is not: it must be corrected for the motion first.
        """
        turn = self.drive.turn(frame)
        heights = self._heights(turn.points)
        if turn.seconds is None:
            self._write(frame, turn.points, heights, turn)
        return landmarks(turn, heights, self.mounting, self.config)

    def cut(
        self, frame: int, scan: Points, heights: Float[np.ndarray, "n"], as_measured: Points
    ) -> CutScan:
        """The clusters of a frame that may be vehicles.

        Args:
            frame: which.
            scan: whole, sensor frame, metres; it may be empty.
            heights: of its points above the ground.
            as_measured: the same points before they were corrected for motion.
        """
        del frame, as_measured
        level = self.mounting.level(scan)
        ceiling = at_ceiling(level, np.hypot(level[:, 0], level[:, 1]), self.config.trajectory)
        parts = find_clusters(level, np.where(ceiling, np.nan, heights), self.config.clusters)
        rows = np.concatenate(parts) if parts else np.empty(0, np.int64)
        counts = np.array([len(part) for part in parts], np.int64)
        return CutScan(scan.take(rows, axis=0), rows.astype(np.int32), counts, len(scan))

    def _heights(self, scan: Points) -> Float[np.ndarray, "n"]:
        level = self.mounting.level(scan)
        return height_above_ground(level, self.mounting.height_m, self.config.ground)

    def _write(
        self,
        frame: int,
        scan: Points,
        heights: Float[np.ndarray, "n"],
        turn: Turn,
    ) -> None:
        found = self.cut(frame, scan, heights, turn.points)
        met = turn.met if turn.seconds is None else turn.seconds
        seconds = np.empty(0) if met is None else met[found.rows]
        arrays = {
            "points": found.points,
            "rows": found.rows,
            "counts": found.counts,
            "scanned": np.array(found.scanned),
            "tracks": np.array(found.tracks, np.str_),
            "grounds": self._grounds(found, heights),
            "seconds": seconds.astype(np.float32),
        }
        with atomic_write(cut_file(self.folder, frame)) as file:
            np.savez(file, **arrays)

    def _grounds(self, found: CutScan, heights: Float[np.ndarray, "n"]) -> Points:
        """A point of the ground under the middle of each cluster, sensor frame."""
        grounds = np.zeros((len(found.counts), 3))
        above = np.split(heights[found.rows], found.ends[:-1])
        for row, level in enumerate(found.moved(self.mounting.levelling())):
            grounds[row] = level.mean(0)
            grounds[row, 2] = np.median(level[:, 2] - above[row])
        return self.mounting.levelling().inverse().apply_numpy(grounds)


def cut_file(folder: Path, frame: int) -> Path:
    """Where the clusters of a frame are."""
    return folder / f"{frame:06d}.npz"


def read_cut(folder: Path, frame: int) -> CutScan:
    """The clusters of one frame.

    Raises:
        BadInputError: the file is missing or damaged.
    """
    path = cut_file(folder, frame)
    with reading(path, "the clusters of a scan"):
        return _cuts((path, path.stat().st_mtime_ns))


def _read_cut(written: tuple[Path, int]) -> CutScan:
    """A file as it was at a time, nanoseconds."""
    with np.load(written[0], allow_pickle=False) as found:
        arrays = found["points"], found["rows"], found["counts"]
        tracks = tuple(found["tracks"].tolist())
        return CutScan(*arrays, int(found["scanned"]), tracks, found["grounds"], found["seconds"])


_cuts = FrameCache(_read_cut)


def read_cuts(folder: Path, count: int) -> Iterator[CutScan]:
    """The clusters of all frames, one after the other."""
    return (read_cut(folder, frame) for frame in range(count))
