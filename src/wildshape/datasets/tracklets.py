# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI raw's `tracklet_labels.xml`: one labelled box that moves from frame to frame."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import torch
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.geometry.rotation import rotation_z
from wildshape.geometry.se3 import SE3


@dataclass(frozen=True)
class Tracklet:
    """One labelled object of a drive.

    Attributes:
        category: `objectType`, for example `Car`.
        size: full lengths along the box's own x (forward), y (left), z (up), metres.
        first_frame: frame of the first pose; the others follow one a frame.
        T_velo_object: one pose a frame, origin at the box's CENTRE (the file's lies on its floor).
    """

    category: str
    size: tuple[float, float, float]
    first_frame: int
    T_velo_object: SE3

    @property
    def frames(self) -> range:
        """The frames in which the object is labelled."""
        return range(self.first_frame, self.first_frame + len(self.T_velo_object))


def read_tracklets(path: Path) -> list[Tracklet]:
    """All tracklets of a file, in its order.

    Raises:
        BadInputError: the file is missing, is not XML or lacks a field.
    """
    try:
        root = ElementTree.parse(path).getroot()
    except FileNotFoundError:
        raise BadInputError(
            f"{path}: no such file; KITTI's 'tracklets' archive of the drive brings it."
        ) from None
    except ElementTree.ParseError as error:
        raise BadInputError(f"{path}: not valid XML ({error}); download it again.") from None
    items = root.findall("tracklets/item")
    if not items:
        raise BadInputError(f"{path}: holds no tracklets, expected boost XML with <tracklets>.")
    return [_tracklet(item, f"{path}: tracklet {i}") for i, item in enumerate(items)]


def _tracklet(item: ElementTree.Element, where: str) -> Tracklet:
    size = tuple(_number(item, key, where) for key in ("l", "w", "h"))
    poses = item.findall("poses/item")
    if not poses or min(size) <= 0:
        raise BadInputError(f"{where} has {len(poses)} poses and size {size}; download it again.")
    keys = ("tx", "ty", "tz", "rx", "ry", "rz")
    numbers = np.asarray([[_number(pose, key, where) for key in keys] for pose in poses])
    return Tracklet(
        category=(item.findtext("objectType") or "").strip(),
        size=(size[0], size[1], size[2]),
        first_frame=int(_number(item, "first_frame", where)),
        T_velo_object=_poses(numbers, size[2]),
    )


def _poses(numbers: Float[np.ndarray, "V 6"], height: float) -> SE3:
    """Poses of the box's centre; KITTI labels only yaw: rx = ry = 0 in every published file."""
    numbers_t = torch.as_tensor(numbers, dtype=torch.float64)
    translation = numbers_t[:, :3].clone()
    translation[:, 2] += height / 2
    return SE3(rotation_z(numbers_t[:, 5]), translation)


def _number(element: ElementTree.Element, key: str, where: str) -> float:
    text = element.findtext(key)
    try:
        value = float(text or "")
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise BadInputError(f"{where}: <{key}> is {text!r}, expected a number; download it again.")
    return value
