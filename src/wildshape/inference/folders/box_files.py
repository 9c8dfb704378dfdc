# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`--boxes`: all boxes of a finished output, in the formats of data sets.

To add a format: a writer in `io/boxes/`, and what is said of it in `_FORMATS`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildshape.arguments import check_fields
from wildshape.errors import BadInputError
from wildshape.io.atomic import write_text

if TYPE_CHECKING:
    from wildshape.geometry.transforms.se3 import SE3
    from wildshape.io.boxes.detections import Detection
    from wildshape.io.boxes.kitti import KittiCamera

_FOLDER = "boxes"
_OF_CAMERAS = (
    "boxes of depth cameras: KITTI's labels are in the camera's frame; nuScenes' and Argoverse 2's"
    " have its axes turned to x forward, y left, z up"
)
_CURE = "KITTI's calibration brings it"
_EGO_CURE = "a log of Argoverse 2 brings it as calibration/egovehicle_SE3_sensor.feather"


@dataclass(frozen=True)
class BoxFiles:
    """Which box files to write.

    Attributes:
        formats: of `BOX_FORMATS`.
        calibration: KITTI's `.txt`, or Argoverse 2's `egovehicle_SE3_sensor.feather`.
    """

    formats: tuple[str, ...]
    calibration: Path | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    def identity(self) -> dict[str, Any]:
        """What decides the content of the box files."""
        calibration = self.calibration and str(self.calibration.resolve())
        return {"boxes": sorted(self.formats), "calibration": calibration}

    @property
    def uses_calibration(self) -> bool:
        """Whether a format asked for takes the calibration."""
        return any(map(self._calibrates, self.formats))

    def check(self) -> None:
        """Refuse before any work is done what could not be written after it.

        Raises:
            BadInputError: a format that there is not; a calibration that cannot be read, or that
                no format asked for takes.
            MissingExtraError: a format needs a library that is not installed.
        """
        for unknown in set(self.formats) - {*BOX_FORMATS}:
            known = ", ".join(BOX_FORMATS)
            raise BadInputError(f"--boxes {unknown}: no such format; there are {known}.")
        for kind in self.formats:
            _FORMATS[kind].check()
        if self.calibration is None:
            return
        if not self.uses_calibration:
            raise BadInputError(
                f"--calibration {self.calibration}: --boxes kitti takes KITTI's .txt, --boxes"
                " argoverse2 takes egovehicle_SE3_sensor.feather; name that format, too."
            )
        for kind in self.formats:
            self._calibration(kind)

    def write(self, out: Path) -> list[str]:
        """Write them from the `objects.json` of every track below `out`.

        Returns:
            Sentences on what to know of them.
        """
        from wildshape.io.boxes.detections import read_detections

        return self.write_detections(out, read_detections(out))

    def write_detections(
        self, out: Path, detections: "Sequence[Detection]", sequence: str = ""
    ) -> list[str]:
        """Write these below `out`; returns as `write` does.

        `sequence` is the drive that they are of, if it is one: evaluations of KITTI tracking want
        its file of labels although nothing was found.
        """
        for kind in self.formats:
            made = _FORMATS[kind]
            made.write(out / _FOLDER / made.file, detections, self._calibration(kind))
        if sequence and not detections and "kitti" in self.formats:
            write_text((out / _FOLDER / _FORMATS["kitti"].file).with_name(f"{sequence}.txt"), "")
        bare = [_FORMATS[kind].bare for kind in self.formats if not self._calibrates(kind)]
        if any(one.sensor == "camera" for one in detections):
            return [_OF_CAMERAS] if set(self.formats) & {"nuscenes", "argoverse2"} else []
        return [sentence for sentence in bare if sentence]

    def _calibrates(self, kind: str) -> bool:
        known = self.calibration
        return known is not None and known.suffix.lower() == _FORMATS[kind].suffix

    def _calibration(self, kind: str) -> Any:
        read, known = _FORMATS[kind].calibrated, self.calibration
        return read(known) if read and known and self._calibrates(kind) else None


def _json(path: Path, detections: "Sequence[Detection]", _: None) -> None:
    from wildshape.io.boxes.detections import write_box_list

    write_box_list(path, detections)


def _nuscenes(path: Path, detections: "Sequence[Detection]", _: None) -> None:
    from wildshape.io.boxes.nuscenes import write_nuscenes_boxes

    write_nuscenes_boxes(path, [_in_lidar_axes(one) for one in detections])


def _in_lidar_axes(one: "Detection") -> "Detection":
    """A camera's box with x forward, y left, z up, as formats of LiDARs expect."""
    from wildshape.io.boxes.detections import moved
    from wildshape.io.boxes.kitti import camera_at_the_lidar

    if one.sensor == "lidar":
        return one
    return replace(one, box=moved(one.box, camera_at_the_lidar().T_rect_sensor.inverse()))


def _kitti(path: Path, detections: "Sequence[Detection]", camera: "KittiCamera | None") -> None:
    from wildshape.io.boxes.kitti import camera_at_the_lidar, write_kitti_labels

    write_kitti_labels(path.parent, detections, camera or camera_at_the_lidar())


def _argoverse2(path: Path, detections: "Sequence[Detection]", T_ego_sensor: "SE3 | None") -> None:
    from wildshape.io.boxes.argoverse2 import write_argoverse2_boxes

    write_argoverse2_boxes(path, [_in_lidar_axes(one) for one in detections], T_ego_sensor)


def _check_arrow() -> None:
    from wildshape.io.boxes.argoverse2 import load_pyarrow

    load_pyarrow()


def read_camera(path: Path) -> "KittiCamera":
    """The rectified camera of KITTI's calibration: tracking's, object's or odometry's file.

    Raises:
        BadInputError: it cannot be read.
    """
    from wildshape.datasets.kitti.calibration import read_calibration, rigid
    from wildshape.io.boxes.kitti import KittiCamera

    known = read_calibration(path, _CURE)
    T_camera_velo = rigid(known, ("Tr_velo_to_cam", "Tr_velo_cam", "Tr"), path)
    rectified = any(name in known for name in ("R0_rect", "R_rect"))
    T = rigid(known, ("R0_rect", "R_rect"), path) @ T_camera_velo if rectified else T_camera_velo
    projection = known.get("P2")
    if projection is not None and len(projection) != 12:
        raise BadInputError(f"{path}: P2 has {len(projection)} numbers, expected 12; {_CURE}.")
    return KittiCamera(T, None if projection is None else projection.reshape(3, 4))


def _ego(path: Path) -> "SE3":
    from wildshape.datasets.argoverse2.log import sensor_pose_in

    return sensor_pose_in(path, "both", _EGO_CURE)


@dataclass(frozen=True)
class _Format:
    """What there is to know of a format.

    Attributes:
        file: below the folder of boxes; a pattern where a track has a file of its own.
        write: the file, detections, and what `calibrated` read or None.
        suffix: of a calibration, if it takes one.
        calibrated: reads it.
        bare: what to know of boxes that were written without.
        check: whether it can be written at all.
    """

    file: str
    write: Callable[[Path, "Sequence[Detection]", Any], None]
    suffix: str = ""
    calibrated: Callable[[Path], Any] | None = None
    bare: str = ""
    check: Callable[[], None] = lambda: None


_FORMATS = {
    "json": _Format("boxes.json", _json),
    "kitti": _Format(
        "kitti/*.txt",
        _kitti,
        suffix=".txt",
        calibrated=read_camera,
        bare="KITTI's labels are written for a camera at the LiDAR's own place that looks along x;"
        " pass --calibration FILE (KITTI's .txt) for the real one",
    ),
    "nuscenes": _Format(
        "nuscenes.json",
        _nuscenes,
        bare="nuScenes' records are in each scan's sensor frame; apply your ego poses and"
        " calibration for the global frame",
    ),
    "argoverse2": _Format(
        "argoverse2/annotations.feather",
        _argoverse2,
        suffix=".feather",
        calibrated=_ego,
        bare="Argoverse 2's table is in the sensor frame; pass --calibration FILE"
        " (egovehicle_SE3_sensor.feather) for the egovehicle's",
        check=_check_arrow,
    ),
}
BOX_FORMATS = tuple(_FORMATS)
BOX_FILES = tuple(f"{_FOLDER}/{kind.file}" for kind in _FORMATS.values())
