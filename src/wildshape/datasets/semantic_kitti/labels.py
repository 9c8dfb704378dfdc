# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""SemanticKITTI's `.label` files: which vehicle each point of a scan lies on.

A label is a uint32: the class in the lower 16 bits, the instance in the upper 16. Instances are
numbered per class and sequence, and keep their number over the whole sequence, also where the car
comes by again; so the whole label names an object. Instance 0: not told apart.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import UInt32

from wildshape.datasets.tracks.selection import Motion
from wildshape.errors import BadInputError, SharedInputError
from wildshape.io.guard import reading

Labels = UInt32[np.ndarray, "_"]

# Category: class when it stood, class when it moved at any time while it was observed.
CLASSES: dict[str, tuple[int, ...]] = {
    "car": (10, 252),
    "bicycle": (11,),
    "bus": (13, 257),
    "motorcycle": (15,),
    "on-rails": (16, 256),
    "truck": (18, 258),
    "other-vehicle": (20, 259),
}
VEHICLES = ("car", "bus", "truck", "other-vehicle")
LABELS_CURE = "SemanticKITTI's archive (data_odometry_labels.zip) brings it"
_OTHERS = (0, 1, 30, 31, 32, 40, 44, 48, 49, 50, 51, 52, 60, 70, 71, 72, 80, 81, 99, 253, 254, 255)
_KNOWN = np.isin(np.arange(1 << 16), (*_OTHERS, *(i for ids in CLASSES.values() for i in ids)))


@dataclass(frozen=True)
class Kind:
    """What a class id says of an object: its category, and whether it moved."""

    category: str
    moved: bool


@dataclass(frozen=True)
class Visit:
    """A stretch of a sequence in which an object is seen well enough.

    Attributes:
        label: of the object, class and instance.
        frames: in which it has enough points, rising.
        number: 0 for the object's first visit.
    """

    label: int
    frames: tuple[int, ...]
    number: int = 0


def categories_of(categories: Iterable[str], motion: Motion) -> dict[int, Kind]:
    """The class ids that are asked for.

    Raises:
        BadInputError: a category is none of `CLASSES`.
    """
    kinds = {}
    for category in categories:
        if category not in CLASSES:
            raise SharedInputError(
                f"'{category}' is no category of SemanticKITTI that holds rigid objects; there are "
                f"{', '.join(CLASSES)}."
            )
        for class_id, moved in zip(CLASSES[category], (False, True)):
            if motion == "any" or moved == (motion == "moving"):
                kinds[class_id] = Kind(category, moved)
    return kinds


def read_labels(path: Path) -> Labels:
    """The labels of one scan's points.

    Raises:
        BadInputError: the file is truncated or holds classes that SemanticKITTI does not have.
    """
    with reading(path, "labels (uint32)"):
        size = path.stat().st_size
        labels = np.fromfile(path, dtype="<u4")
    if size % 4:
        raise BadInputError(
            f"{path}: {size} bytes, expected a multiple of 4 (uint32); the file is truncated, "
            "download it again."
        )
    known = _KNOWN[labels & 0xFFFF]
    if not known.all():
        raise BadInputError(
            f"{path}: class {int(labels[~known][0]) & 0xFFFF} is none of SemanticKITTI's; give the "
            "labels as published, not remapped for training."
        )
    return labels


def on_objects(labels: Labels, class_ids: Iterable[int]) -> np.ndarray:
    """Indices of the points that lie on an instance of these classes."""
    wanted = np.isin(np.arange(1 << 16), list(class_ids))
    return np.flatnonzero(wanted[labels & 0xFFFF] & (labels >> 16 > 0))


def count_points(files: Mapping[int, Path], class_ids: Iterable[int]) -> dict[int, dict[int, int]]:
    """For each object (by label) its number of points in the frames (by number) that show it.

    Raises:
        BadInputError: see `read_labels`.
    """
    ids = tuple(class_ids)
    counts: dict[int, dict[int, int]] = {}
    for frame, path in sorted(files.items()):
        labels = read_labels(path)
        found, points = np.unique(labels[on_objects(labels, ids)], return_counts=True)
        for label, count in zip(found.tolist(), points.tolist()):
            counts.setdefault(label, {})[frame] = count
    return counts


def visits_of(label: int, frames: list[int], gap: int | None) -> list[Visit]:
    """An object's frames, cut where it is not seen for more than `gap` frames; None: never."""
    cuts: list[int] = []
    if gap is not None:
        cuts = [i for i in range(1, len(frames)) if frames[i] - frames[i - 1] - 1 > gap]
    bounds = zip([0, *cuts], [*cuts, len(frames)])
    return [Visit(label, tuple(frames[a:b]), i) for i, (a, b) in enumerate(bounds) if a < b]
