# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""KITTI raw's `tracklet_labels.xml`: one labelled box that moves from frame to frame."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import torch
from jaxtyping import Float

from wildshape.datasets.tracks.labelled_boxes import check_boxes
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.boxes.detector import MOST_TURN
from wildshape.io.guard import reading

_PIECE = 1 << 16
_DEEPEST, _MOST_ELEMENTS = 16, 200_000  # of one tracklet; each pose has a dozen elements
_MOST_FRAMES = 1_000_000


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
    """All tracklets of a file, in its order; one held as XML at a time.

    Raises:
        BadInputError: the file is missing, is not XML or lacks a field.
    """
    if not path.is_file():
        raise BadInputError(
            f"{path}: no such file; KITTI's 'tracklets' archive of the drive brings it."
        )
    with reading(path, "KITTI's tracklets, XML in UTF-8"):
        text = path.read_text("utf-8-sig")
        if "<!ENTITY" in text:
            raise BadInputError(f"{path}: defines entities, unlike KITTI's; download it again.")
        items = enumerate(_items(text))
        try:
            tracklets = [_tracklet(item, f"{path}: tracklet {i}") for i, item in items]
        except ElementTree.ParseError as error:
            raise BadInputError(f"{path}: not valid XML ({error}); download it again.") from None
    if not tracklets:
        raise BadInputError(f"{path}: holds no tracklets, expected boost XML with <tracklets>.")
    return tracklets


def _items(text: str) -> Iterator[ElementTree.Element]:
    """Each `tracklets/item` as soon as it ends; what has been handed out is forgotten."""
    parser = ElementTree.XMLPullParser(("start", "end"))  # of text: what it says of its encoding
    open_elements: list[ElementTree.Element] = []  # does not matter
    count = 0
    for at in range(0, len(text), _PIECE):
        parser.feed(text[at : at + _PIECE])
        events: Iterator[Any] = parser.read_events()
        for event, element in events:
            count += 1
            if event == "start":
                open_elements.append(element)
                if len(open_elements) > _DEEPEST or count > 2 * _MOST_ELEMENTS:
                    raise ElementTree.ParseError("nested deeper or longer than KITTI's tracklets")
                continue
            open_elements.pop()
            if len(open_elements) > 2:
                continue
            if [e.tag for e in (*open_elements[1:], element)] == ["tracklets", "item"]:
                yield element
            if open_elements:
                open_elements[-1].clear()
            count = 0
    parser.close()


def _tracklet(item: ElementTree.Element, where: str) -> Tracklet:
    size = tuple(_number(item, key, where) for key in ("l", "w", "h"))
    poses = item.findall("poses/item")
    first = _number(item, "first_frame", where)
    if not poses or min(size) <= 0 or not (0 <= first < _MOST_FRAMES and first == int(first)):
        raise BadInputError(
            f"{where} has {len(poses)} poses from frame {first:g} and size {size}; download it "
            "again."
        )
    keys = ("tx", "ty", "tz", "rx", "ry", "rz")
    numbers = np.asarray([[_number(pose, key, where) for key in keys] for pose in poses])
    turn = float(np.abs(numbers[:, 5]).max())
    if turn > MOST_TURN:
        raise BadInputError(f"{where}: <rz> is {turn:g}, expected radians; write these.")
    T_velo_object = _poses(numbers, size[2])
    sizes = np.asarray([size] * len(poses))
    check_boxes(sizes, T_velo_object, where, "download it again")
    return Tracklet(
        category=(item.findtext("objectType") or "").strip(),
        size=(size[0], size[1], size[2]),
        first_frame=int(first),
        T_velo_object=T_velo_object,
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
