# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One sequence of SemanticKITTI: its files, its poses, the labelled points of its frames."""

from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import numpy as np

from wildshape.datasets.kitti.calibration import read_calibration, read_odometry, rigid
from wildshape.datasets.semantic_kitti.labels import (
    LABELS_CURE,
    Kind,
    Labels,
    Visit,
    on_objects,
    read_labels,
)
from wildshape.datasets.tracks.parts import found_in, numbered
from wildshape.datasets.tracks.selection import measured
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.scans.arrays import read_rows
from wildshape.records import Points

_SCANS = "velodyne"
_PLACES = 10  # of the sensor in a turn: rays of one place are looked at together
_CALIBRATION_CURE = "KITTI odometry's calibration archive (data_odometry_calib.zip) brings it"


class Words(TypedDict):
    """What `Gathering.wants` asks about an object."""

    name: str
    category: str
    source: str


@dataclass(frozen=True)
class Sequence:
    """An opened sequence.

    Attributes:
        name: of the sequence, the beginning of its tracks' names.
        files: the label file of each frame that has one.
        kinds: the class ids that are asked for.
        T_velo_world: one pose a frame, from odometry; the world is the first frame's velodyne
            frame. None where there are neither calib.txt nor poses.txt: scans without truth.
    """

    folder: Path
    name: str
    files: dict[int, Path]
    kinds: dict[int, Kind]
    T_velo_world: SE3 | None

    def kind(self, visit: Visit) -> Kind:
        """Category of an object, and whether it moved."""
        return self.kinds[visit.label & 0xFFFF]

    def words(self, visit: Visit) -> Words:
        """An object's name, category and source."""
        kind = self.kind(visit)
        moving, state = ("moving-", "moving") if kind.moved else ("", "parked")
        again = f"_{visit.number + 1}" if visit.number else ""
        name = f"{self.name}_{moving}{kind.category}_{visit.label >> 16:05d}{again}"
        return Words(name=name, category=kind.category, source=f"SemanticKITTI, {state}")

    def scan_file(self, frame: int) -> Path:
        """The velodyne file of a frame, which may be missing."""
        return self.folder / _SCANS / f"{self.files[frame].stem}.bin"

    def labelled_points(self, frame: int, *, whole: bool = False) -> tuple[Labels, Points] | None:
        """Label and position of the points on objects of the kinds asked for, or of all points.

        None where the frame has no scan.

        Raises:
            BadInputError: the scan is truncated, or is not as long as its labels.
        """
        path = self.scan_file(frame)
        if not path.is_file():
            return None
        raw = read_rows(path, "x y z intensity")
        labels = read_labels(self.files[frame])
        if len(raw) != len(labels):
            raise BadInputError(
                f"{path}: {len(raw)} points, but {self.files[frame]} has {len(labels)} "
                "labels; they are not of the same frame, download both again."
            )
        index = np.arange(len(raw)) if whole else on_objects(labels, self.kinds)
        points = raw[index]
        kept = measured(points)
        return labels[index[kept]], points[kept]

    def ray_starts(self, frame: int, points: Points) -> Points | None:
        """Where the ray of each point of a whole scan began, sensor frame, metres, if it is known.

        KITTI odometry gives points as seen at the turn's middle. The beam comes from behind over
        the left side and the front, and the sensor goes on meanwhile.
        """
        T = self.T_velo_world
        if T is None:
            return None
        before, after = max(frame - 1, 0), min(frame + 1, len(T) - 1)
        first, last = ((T[frame] @ T[i].inverse()).translation.numpy() for i in (before, after))
        turn = -np.arctan2(points[:, 1], points[:, 0]) / (2 * np.pi)  # since its middle
        turn = np.rint(turn * _PLACES) / _PLACES
        return (turn[:, None] * (last - first) / max(after - before, 1)).astype(np.float32)


def open_sequence(folder: Path, name: str, labels: str, kinds: dict[int, Kind]) -> Sequence:
    """Read what all frames share.

    Raises:
        BadInputError: no labels, scans, calibration or poses, or fewer poses than frames.
    """
    files = numbered(folder / labels, ".label", f"no .label files; {LABELS_CURE}")
    if not (folder / _SCANS).is_dir():
        raise BadInputError(
            f"{folder / _SCANS}: no such folder; KITTI odometry's scans "
            "(data_odometry_velodyne.zip) bring it."
        )
    if not (folder / "calib.txt").exists() and not (folder / "poses.txt").exists():
        return Sequence(folder, name, files, kinds, None)
    calibration = read_calibration(folder / "calib.txt", _CALIBRATION_CURE)
    T_camera_velo = rigid(calibration, ("Tr", "Tr_velo_to_cam"), folder / "calib.txt")
    T_world_camera = read_odometry(folder / "poses.txt", LABELS_CURE)
    if len(T_world_camera) <= max(files):
        raise BadInputError(
            f"{folder / 'poses.txt'}: {len(T_world_camera)} poses, but there is a frame "
            f"{max(files)}; {LABELS_CURE} whole."
        )
    T_world_velo = T_camera_velo.inverse() @ T_world_camera @ T_camera_velo
    return Sequence(folder, name, files, kinds, T_world_velo.inverse())


def find_sequences(root: Path) -> dict[str, Path]:
    """Folders of sequences by name, sorted.

    Raises:
        BadInputError: there is none.
    """
    if _is_sequence(root):
        return {root.resolve().name: root}
    for above in (root / "dataset" / "sequences", root / "sequences", root):
        folders = sorted(above.iterdir()) if above.is_dir() else []
        found = {folder.name: folder for folder in folders if _is_sequence(folder)}
        if found:
            return found
    raise BadInputError(
        f"{root}: {found_in(root)}; give SemanticKITTI's folder with"
        " sequences/00/velodyne in it, or one sequence."
    )


def _is_sequence(folder: Path) -> bool:
    return (folder / _SCANS).is_dir() or (folder / "labels").is_dir()
