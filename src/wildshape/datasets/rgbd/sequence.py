# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One sequence of RGB-D frames on disk: camera, depth images, masks, camera poses."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Shaped

from wildshape.datasets.rgbd.depth_image import first_size, measured, read_depth_png
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import read_json
from wildshape.io.order import check_counted
from wildshape.io.poses import read_poses
from wildshape.io.tracks import folder_name
from wildshape.records import Intrinsics, Points

_KEYS = ("fx", "fy", "cx", "cy", "depth_scale")
_BENT = ("distortion", "dist_coeffs", "coeffs", "k1", "k2", "p1", "p2", "k3")  # of a lens
_INSTANCE = re.compile(r"[0-9]{1,9}")
_MOST, _LEAST = 1e9, 1e-6
_MIDDLE = (0.3, 0.7)  # of an image: where a camera's axis meets it, unless it is a part of one


@dataclass(frozen=True)
class Sequence:
    """One folder of frames.

    Attributes:
        depth: the depth images in time order.
        camera: pixel i covers [i, i + 1): half a pixel is added to the file's cx and cy.
        depth_scale: units of the depth images in a metre.
        categories: of the instances, as far as said.
        T_world_camera: one a depth image, if known.
    """

    folder: Path
    depth: tuple[Path, ...]
    camera: Intrinsics
    depth_scale: float
    categories: dict[int, str]
    T_world_camera: SE3 | None

    @property
    def name(self) -> str:
        """What the folder is called."""
        return folder_name(self.folder)

    def read_depth(self, path: Path) -> Float[np.ndarray, "h w"]:
        """A depth image in metres, 0 where nothing was measured.

        Raises:
            BadInputError: damaged, or of another size than camera.json says.
        """
        raw = read_depth_png(path)
        self.check_size(raw, path)
        return measured(raw) / self.depth_scale

    def check_size(self, image: Shaped[np.ndarray, "h w"], path: Path) -> None:
        """Refuse an image of another size than the others.

        Raises:
            BadInputError: it is.
        """
        expected, found = (self.camera.width, self.camera.height), image.shape[::-1]
        if found != expected:
            raise BadInputError(
                f"{path}: {found[0]} x {found[1]} pixels, expected"
                f" {expected[0]} x {expected[1]} as camera.json or the first depth image has."
            )

    def masks(self, stem: str) -> list[tuple[int | None, Path]]:
        """Mask files of a frame; with the instance where each has its own."""
        folder = self.folder / "masks"
        together = folder / f"{stem}.png"
        if together.is_file():
            return [(None, together)]
        alone = sorted(folder.glob(f"*/{stem}.png"), key=lambda file: file.parent.name)
        return [(_number(file.parent), file) for file in alone]

    @property
    def doubt(self) -> str:
        """A sentence where the camera seems to be of images of another size; else nothing."""
        camera, (low, high) = self.camera, _MIDDLE
        across, down = camera.cx / camera.width, camera.cy / camera.height
        if low <= min(across, down) and max(across, down) <= high:
            return ""
        return (
            f"{self.folder / 'camera.json'}: cx {camera.cx - 0.5:g}, cy {camera.cy - 0.5:g} lie far"
            f" from the middle of images of {camera.width} x {camera.height} pixels; if they are of"
            " another size, scale fx, fy, cx and cy with them"
        )

    def place(self, frame: int, points: Points) -> Float[np.ndarray, "3"] | None:
        """Where the middle of some points lies in the world, metres, if the camera's pose says."""
        if self.T_world_camera is None or not len(points):
            return None
        middle = np.median(points, axis=0, keepdims=True).astype(np.float64)
        return self.T_world_camera[frame].apply_numpy(middle)[0]


def open_sequence(folder: Path) -> Sequence:
    """Read what a sequence says about itself.

    Raises:
        BadInputError: camera.json, the depth images or the masks are missing or damaged.
    """
    images = (file for file in (folder / "depth").glob("*.png") if not file.name.startswith("."))
    depth = tuple(sorted(images, key=lambda file: file.name))
    if not depth:
        raise BadInputError(
            f"{folder / 'depth'}: no .png; write the depth images here as 16-bit PNG."
        )
    check_counted(depth)
    if not (folder / "masks").is_dir():
        raise BadInputError(f"{folder / 'masks'}: no such folder; a sequence keeps its masks here.")
    _check_instances(folder / "masks")
    expected = f"JSON with {', '.join(_KEYS)}"
    raw = read_json(folder / "camera.json", expected, dict)
    poses = folder / "poses.txt"
    return Sequence(
        folder,
        depth,
        _camera(raw, first_size(depth), folder / "camera.json"),
        _depth_scale(raw["depth_scale"], folder / "camera.json"),
        _categories(folder / "objects.json"),
        read_poses(poses, len(depth)) if poses.exists() else None,
    )


def instances_of(
    mask: Shaped[np.ndarray, "h w"], instance: int | None
) -> Iterator[tuple[int, Bool[np.ndarray, "h w"]]]:
    """The instances in a mask, each with its own pixels.

    Args:
        mask: instance numbers, or of one instance: not 0.
        instance: the one, if the mask is of one.
    """
    if instance is not None:
        if (mask != 0).any():
            yield instance, mask != 0
        return
    for number in np.unique(mask):
        if number:
            yield int(number), mask == number


def _camera(raw: dict[str, Any], size: tuple[int, int], path: Path) -> Intrinsics:
    missing = [key for key in _KEYS if key not in raw]
    if missing:
        raise BadInputError(
            f"{path}: lacks {', '.join(missing)}; depth_scale is the units in a metre, the"
            " others are in pixels."
        )
    bent = next((key for key in _BENT if _bends(raw.get(key))), None)
    if bent is not None:
        raise BadInputError(
            f"{path}: {bent} is not 0, but points are made as of undistorted images; undistort"
            f" depth and masks, and leave {bent} out."
        )
    fx, fy = (_positive(raw[key], key, path) for key in ("fx", "fy"))
    # A calibration takes whole numbers for the pixels' centres (OpenCV, ROS, BOP).
    cx, cy = (_number_of(raw[key], key, path) + 0.5 for key in ("cx", "cy"))
    width, height = (int(_positive(raw.get(k, n), k, path)) for k, n in zip(_SIZES, size))
    return Intrinsics(fx, fy, cx, cy, width, height)


_SIZES = ("width", "height")


def _bends(value: object) -> bool:
    """Whether a coefficient, or one of a list of them, is not 0."""
    numbers = value if isinstance(value, list) else [value]
    return any(isinstance(number, int | float) and number != 0 for number in numbers)


def _depth_scale(value: object, path: Path) -> float:
    """Units in a metre; no image of 16 bits has units larger than metres."""
    scale = _positive(value, "depth_scale", path)
    if scale < 1:
        raise BadInputError(
            f"{path}: depth_scale is {scale:g}, expected the units in a metre; if it is metres in a"
            f" unit, write {1 / scale:g}."
        )
    return scale


def _positive(value: object, key: str, path: Path) -> float:
    number = _number_of(value, key, path)
    if number < _LEAST:
        raise BadInputError(f"{path}: {key} is {str(value)[:40]}, expected a number above 0.")
    return number


def _number_of(value: object, key: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= _MOST:
        raise BadInputError(f"{path}: {key} is {str(value)[:40]}, expected a number.")
    return float(value)


def _categories(path: Path) -> dict[int, str]:
    if not path.exists():
        return {}
    raw = read_json(path, 'JSON such as {"1": "mug"}', dict)
    wrong = next((key for key in raw if not _INSTANCE.fullmatch(key)), None)
    if wrong is not None:
        raise BadInputError(f"{path}: '{wrong}' is no instance number; write such as 1.")
    return {int(key): str(word) for key, word in raw.items()}


def _check_instances(masks: Path) -> None:
    """Refuse what would lose objects: two folders of one instance, or folders beside images."""
    named: dict[int, str] = {}
    for folder in sorted(masks.iterdir()):
        if not folder.is_dir() or not _INSTANCE.fullmatch(folder.name):
            continue
        other = named.setdefault(int(folder.name), folder.name)
        if other != folder.name:
            raise BadInputError(
                f"{folder}: {other} beside it is of the same instance; give each object a number of"
                " its own."
            )
    together = next(iter(sorted(masks.glob("[!.]*.png"))), None)
    if named and together is not None:
        raise BadInputError(
            f"{together}: an image of all instances beside folders of single ones, such as"
            f" {next(iter(named.values()))}; keep one of the two."
        )


def _number(folder: Path) -> int:
    if not _INSTANCE.fullmatch(folder.name):
        raise BadInputError(f"{folder}: the folder of an instance's masks is a number, such as 3.")
    return int(folder.name)
