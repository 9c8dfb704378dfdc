# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Labels of a drive: KITTI tracking's, or the truth of a simulated one in the same layout.

A label counts if it is of a vehicle with enough points that was looked at. Vehicles with fewer,
other things and regions that nobody cared to label are neither to be found nor to be left alone.
"""

import math
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.arguments import as_path, check_fields, expect
from wildshape.datasets.kitti.calibration import read_calibration, rigid
from wildshape.datasets.kitti.oxts import read_oxts
from wildshape.datasets.kitti.raw import read_velodyne
from wildshape.datasets.kitti.tracking import VEHICLES
from wildshape.datasets.kitti.tracking_labels import LabelledBox, read_boxes
from wildshape.datasets.tracks.parts import numbered
from wildshape.errors import BadInputError
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.geometry.box import SIGNS
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.table import read_box_table
from wildshape.io.guard import reading
from wildshape.io.poses import read_poses

_BESIDE = "the calibration that was published with the labels belongs beside them"
_IGNORED = "DontCare"


@dataclass(frozen=True)
class Counting:
    """What counts; saved with the results.

    Attributes:
        points: a labelled vehicle has at least so many, else it is not asked for.
        range_m: farthest box, metres, in the ground plane; only where a camera's labels are read.
        image: width and height of that camera's picture, pixels.
        on: part of a found box's footprint, or of its box in the picture, on something that is not
            asked for, from which it is no mistake.
    """

    points: int = 100
    range_m: float = 60.0
    image: tuple[int, int] = (1242, 375)
    on: float = 0.5

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Label:
    """One labelled thing in one frame.

    Attributes:
        track: its number in the drive.
        vehicle: or something else.
        box: in the sensor frame.
        counted: whether it is to be found.
    """

    track: int
    vehicle: bool
    box: UprightBox
    counted: bool


@dataclass(frozen=True)
class View:
    """What a labelled camera sees.

    Attributes:
        projection: `(3, 4)` from the LiDAR's frame to pixels.
        counting: range and size of the picture.
    """

    projection: Float[np.ndarray, "3 4"]
    counting: Counting

    def sees(self, box: UprightBox) -> bool:
        """Whether a box's middle is in the picture and near enough."""
        u, v, depth = self.projection @ (box.x, box.y, box.z, 1.0)
        width, height = self.counting.image
        inside = depth > 0 and 0 <= u <= width * depth and 0 <= v <= height * depth
        return bool(inside and math.hypot(box.x, box.y) <= self.counting.range_m)

    def picture(self, box: UprightBox) -> tuple[float, float, float, float] | None:
        """Left, top, right, bottom of a box, pixels, cut at the edge; None if it is not ahead."""
        c, s = math.cos(box.yaw), math.sin(box.yaw)
        turn = np.array(((c, -s, 0), (s, c, 0), (0, 0, 1)))
        corners = SIGNS * np.array(box[3:6]) / 2 @ turn.T + np.array(box[:3])
        u, v, depth = self.projection @ np.pad(corners, ((0, 0), (0, 1)), constant_values=1.0).T
        if (depth <= 0.1).any():
            return None
        width, height = self.counting.image
        u, v = np.clip(u / depth, 0, width), np.clip(v / depth, 0, height)
        return float(u.min()), float(v.min()), float(u.max()), float(v.max())


@dataclass(frozen=True)
class LabelledFrame:
    """The labels of one scan.

    Attributes:
        regions: `(k, 4)` left, top, right, bottom that nobody cared to label, pixels.
    """

    labels: tuple[Label, ...]
    regions: Float[np.ndarray, "k 4"]


@dataclass(frozen=True)
class LabelledDrive:
    """The labels of a drive.

    Attributes:
        path: of the labels.
        frames: one a scan, in the order of the scans.
        scans: their files.
        view: of the camera that labels were drawn for; None: all around is labelled.
        T_world_sensor: the true trajectory, if known.
    """

    path: Path
    frames: tuple[LabelledFrame, ...]
    scans: tuple[Path, ...]
    view: View | None
    T_world_sensor: SE3 | None
    counting: Counting


@dataclass(frozen=True)
class _Place:
    """The files of one sequence."""

    root: Path
    name: str

    def file(self, folder: str, suffix: str = "txt") -> Path:
        return self.root / folder / f"{self.name}.{suffix}"


def read_labels(path: Path | str, counting: Counting | None = None) -> LabelledDrive:
    """Labels with what lies beside them: `calib`, `velodyne`, and `oxts`, `poses`, `truth`.

    Args:
        path: a file of `label_02`, or the folder above if it holds one sequence.
        counting: what counts.

    Raises:
        BadInputError: a file is missing or damaged, or there are several sequences.
    """
    path, counting = as_path(path, "path"), expect(counting or Counting(), Counting, "counting")
    place = _place(path)
    scans = _scans(place)
    calibration_file = place.file("calib")
    calibration = read_calibration(calibration_file, _BESIDE)
    T_camera_velo = rigid(calibration, ("Tr_velo_to_cam", "Tr_velo_cam"), calibration_file)
    T_rect_velo = rigid(calibration, ("R0_rect", "R_rect"), calibration_file) @ T_camera_velo
    simulated = place.file("truth", "csv").is_file()
    view = None if simulated else View(_projection(calibration, T_rect_velo, place), counting)
    known = _true_points(place) if simulated else None
    labels = read_boxes(place.file("label_02"))
    by_frame: dict[int, list[LabelledBox]] = defaultdict(list)
    for box in labels:
        by_frame[box.frame].append(box)
    regions = _regions(place.file("label_02"))
    frames = []
    for scan in scans:
        number = int(scan.stem)
        boxes = by_frame.get(number, [])
        counts = known or _counts(scan, boxes, T_rect_velo.inverse())
        made = tuple(_label(box, T_rect_velo.inverse(), counts, view, counting) for box in boxes)
        frames.append(LabelledFrame(made, regions.get(number, np.empty((0, 4)))))
    trajectory = _trajectory(place, calibration, scans)
    return LabelledDrive(path, tuple(frames), scans, view, trajectory, counting)


def _place(path: Path) -> _Place:
    if path.is_file():
        return _Place(path.parent.parent, path.stem)
    for root in (path, path / "training"):
        found = sorted((root / "label_02").glob("[!.]*.txt"))
        if len(found) > 1:
            raise BadInputError(
                f"{path}: holds {len(found)} sequences; name one of {root}/label_02."
            )
        if found:
            return _Place(root, found[0].stem)
    raise BadInputError(f"{path}: no label_02/*.txt in it; give a label file of KITTI tracking.")


def _scans(place: _Place) -> tuple[Path, ...]:
    folder = place.root / "velodyne" / place.name
    none = "no .bin scans; labels count by their points, keep the scans beside them"
    return tuple(numbered(folder, ".bin", none).values())


def _projection(calibration: dict[str, np.ndarray], T_rect_velo: SE3, place: _Place) -> np.ndarray:
    numbers = calibration.get("P2")
    if numbers is None or len(numbers) != 12:
        raise BadInputError(f"{place.file('calib')}: no P2 of 12 numbers; {_BESIDE}.")
    return numbers.reshape(3, 4) @ T_rect_velo.matrix.numpy()


def _true_points(place: _Place) -> dict[tuple[int, int], int]:
    path = place.file("truth", "csv")
    rows = read_box_table(path)
    with reading(path, "true boxes"):
        return {(row.frame, int(row.track)): row.points for row in rows}


def _counts(scan: Path, boxes: list[LabelledBox], T_velo_rect: SE3) -> dict[tuple[int, int], int]:
    """Points of a scan in each of its vehicles' boxes."""
    vehicles = [box for box in boxes if box.category in VEHICLES]
    if not vehicles:
        return {}
    points = read_velodyne(scan)
    found = {}
    for box in vehicles:
        T_box_velo = (T_velo_rect @ box.T_rect_object).inverse()
        inside = np.abs(T_box_velo.apply_numpy(points)) <= np.asarray(box.size) / 2
        found[box.frame, box.track] = int(inside.all(1).sum())
    return found


def _label(
    box: LabelledBox,
    T_velo_rect: SE3,
    points: dict[tuple[int, int], int],
    view: View | None,
    counting: Counting,
) -> Label:
    pose = T_velo_rect @ box.T_rect_object
    x, y, z = pose.translation.tolist()
    ahead = pose.rotation[:, 0]
    upright = UprightBox(x, y, z, *box.size, yaw=math.atan2(float(ahead[1]), float(ahead[0])))
    vehicle = box.category in VEHICLES
    enough = points.get((box.frame, box.track), 0) >= counting.points
    seen = view is None or view.sees(upright)
    return Label(box.track, vehicle, upright, vehicle and enough and seen)


def _regions(path: Path) -> dict[int, np.ndarray]:
    """The regions of the picture that nobody cared to label, by frame."""
    found: dict[int, list[list[float]]] = defaultdict(list)
    with reading(path, "KITTI tracking's labels"):
        for line in path.read_text("utf-8", errors="replace").splitlines():
            words = line.split()
            if words[2:3] == [_IGNORED]:
                region = [float(word) for word in words[6:10]]
                if len(region) != 4 or not all(map(math.isfinite, region)):
                    raise ValueError(f"region {words[6:10]}")
                found[int(words[0])].append(region)
    return {frame: np.array(regions) for frame, regions in found.items()}


def _trajectory(
    place: _Place, calibration: dict[str, np.ndarray], scans: tuple[Path, ...]
) -> SE3 | None:
    if place.file("poses").is_file():
        return read_poses(place.file("poses"), len(scans))
    if not place.file("oxts").is_file():
        return None
    T_velo_imu = rigid(calibration, ("Tr_imu_to_velo", "Tr_imu_velo"), place.file("calib"))
    T_world_velo = read_oxts(place.file("oxts")) @ T_velo_imu.inverse()
    numbers = [int(scan.stem) for scan in scans]
    if numbers[-1] >= len(T_world_velo):
        raise BadInputError(
            f"{place.file('oxts')}: {len(T_world_velo)} lines, but there is a scan {numbers[-1]}; "
            "copy the file again."
        )
    poses = T_world_velo.matrix[numbers]
    return SE3.from_matrix(poses)
