# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`--boxes`: all boxes of a finished output, in the formats of data sets."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildshape.errors import BadInputError

if TYPE_CHECKING:
    from wildshape.geometry.transforms.se3 import SE3
    from wildshape.io.boxes.detections import Detection
    from wildshape.io.boxes.kitti import KittiCamera

BOX_FORMATS = ("json", "kitti", "nuscenes", "argoverse2")
_FOLDER = "boxes"
_JSON, _NUSCENES = "boxes.json", "nuscenes.json"
_ARGOVERSE2 = "argoverse2/annotations.feather"
_CURE = "KITTI's calibration brings it"
BOX_FILES = tuple(f"{_FOLDER}/{name}" for name in (_JSON, _NUSCENES, _ARGOVERSE2, "kitti/*.txt"))
_UNCALIBRATED = {
    "kitti": "KITTI's labels are written for a camera at the LiDAR's own place that looks along x;"
    " pass --calibration FILE (KITTI's .txt) for the real one",
    "nuscenes": "nuScenes' records are in each scan's sensor frame; apply your ego poses and"
    " calibration for the global frame",
    "argoverse2": "Argoverse 2's table is in the sensor frame; pass --calibration FILE"
    " (egovehicle_SE3_sensor.feather) for the egovehicle's",
}
_CALIBRATES = {".txt": "kitti", ".feather": "argoverse2"}


@dataclass(frozen=True)
class BoxFiles:
    """Which box files to write.

    Attributes:
        formats: of `BOX_FORMATS`.
        calibration: KITTI's `.txt`, or Argoverse 2's `egovehicle_SE3_sensor.feather`.
    """

    formats: tuple[str, ...]
    calibration: Path | None = None

    def identity(self) -> dict[str, Any]:
        """What decides the content of the box files."""
        calibration = self.calibration and str(self.calibration.resolve())
        return {"boxes": sorted(self.formats), "calibration": calibration}

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
        if "argoverse2" in self.formats:
            from wildshape.io.boxes.argoverse2 import load_pyarrow

            load_pyarrow()
        if self.calibration is None:
            return
        wants = _CALIBRATES.get(self.calibration.suffix.lower())
        if wants not in self.formats:
            raise BadInputError(
                f"--calibration {self.calibration}: --boxes kitti takes KITTI's .txt, --boxes"
                " argoverse2 takes egovehicle_SE3_sensor.feather; name that format, too."
            )
        _camera(self.calibration) if wants == "kitti" else _ego(self.calibration)

    def write(self, out: Path) -> list[str]:
        """Write them from the `objects.json` of every track below `out`.

        Returns:
            Sentences on what to know of them.
        """
        from wildshape.io.boxes.detections import read_detections, write_box_list
        from wildshape.io.boxes.nuscenes import write_nuscenes_boxes

        detections, folder = read_detections(out), out / _FOLDER
        if "json" in self.formats:
            write_box_list(folder / _JSON, detections)
        if "nuscenes" in self.formats:
            write_nuscenes_boxes(folder / _NUSCENES, detections)
        if "kitti" in self.formats:
            self._kitti(folder / "kitti", detections)
        if "argoverse2" in self.formats:
            self._argoverse2(folder / _ARGOVERSE2, detections)
        bare = [kind for kind in self.formats if not self._calibrates(kind)]
        return [_UNCALIBRATED[kind] for kind in bare if kind in _UNCALIBRATED]

    def _calibrates(self, kind: str) -> bool:
        known = self.calibration
        return known is not None and _CALIBRATES.get(known.suffix.lower()) == kind

    def _kitti(self, folder: Path, detections: "Sequence[Detection]") -> None:
        from wildshape.io.boxes.kitti import camera_at_the_lidar, write_kitti_labels

        known = self.calibration if self._calibrates("kitti") else None
        camera = camera_at_the_lidar() if known is None else _camera(known)
        write_kitti_labels(folder, detections, camera)

    def _argoverse2(self, path: Path, detections: "Sequence[Detection]") -> None:
        from wildshape.io.boxes.argoverse2 import write_argoverse2_boxes

        known = self.calibration if self._calibrates("argoverse2") else None
        write_argoverse2_boxes(path, detections, None if known is None else _ego(known))


def _camera(path: Path) -> "KittiCamera":
    """The rectified camera of KITTI's calibration: tracking's, object's or odometry's file."""
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
    from wildshape.datasets.argoverse2.log import read_sensor_pose

    return read_sensor_pose(path.resolve().parent.parent, "both")
