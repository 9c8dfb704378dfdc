# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Objects cut out of full scans by labelled boxes, the same for every data set that has boxes."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Int

from wildshape.datasets.tracks.gathering import Gathering
from wildshape.errors import BadInputError
from wildshape.geometry.projection.full_scan import FullScan, sight_lines
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

_LARGEST_M = 1000.0
WORLD_M = 1e8  # the largest coordinate that a map has


@dataclass(frozen=True)
class Crop:
    """How the points of an object are cut out of a whole scan.

    Attributes:
        margin: the labelled box is enlarged by this on each side and at the top, metres; labels are
            good to 5 cm.
        ground: points lower than this above the box's floor are left out, metres; a negative value
            reaches under the floor.
    """

    margin: float = 0.15
    ground: float = 0.2


@dataclass(frozen=True)
class LabelledObject:
    """One object in one frame.

    Attributes:
        name: of its track, unique in the data set.
        last_frame: number of the last frame that may show it, as far as is known by now.
        category: in the track's own words.
        source: where it comes from, in words.
        size: full lengths along the box's own x (forward), y (left), z (up), metres.
        T_sensor_object: origin at the box's CENTRE.
        place: `(3,)` where it stands in a frame that does not move, metres; None if unknown.
    """

    name: str
    last_frame: int
    category: str
    source: str
    size: tuple[float, float, float]
    T_sensor_object: SE3
    place: Float[np.ndarray, "3"] | None


def crop_objects(
    objects: Iterable[LabelledObject],
    scan_name: str,
    read: Callable[[], Points | FullScan | None],
    crop: Crop,
    to: Gathering,
) -> None:
    """Cut the objects of a frame that are wanted out of its scan, which is read only for them.

    `read` gives the whole scan, sensor frame, metres, or its points `(s, 3)` alone; None where the
    frame has no file. A scan that is missing or damaged is counted.
    """
    wanted = [
        one
        for one in objects
        if to.wants(one.name, one.last_frame, category=one.category, source=one.source)
    ]
    found = to.read(read, len(wanted))
    if found is None:
        return
    full = found if isinstance(found, FullScan) else FullScan(found)
    for one in wanted:
        rows = rows_in_box(full.points, one.T_sensor_object, one.size, crop)
        to.add(
            one.name,
            scan_name,
            full.points[rows],
            one.T_sensor_object,
            one.place,
            rays=partial(sight_lines, full, rows),
            label_size_m=one.size,
        )


def described(data_set: str, size: tuple[float, float, float]) -> str:
    """The `source` of an object, with the size of its box."""
    length, width, height = size
    return f"{data_set}, labelled box {length:.2f} x {width:.2f} x {height:.2f} m"


def rows_in_box(
    cloud: Points, T_sensor_object: SE3, size: tuple[float, float, float], crop: Crop
) -> Int[np.ndarray, " n"]:
    """Which points of a whole scan belong to a box's object, as rows of it in rising order.

    Sensor frame, metres; the box's origin is its CENTRE, x forward, y left, z up, and its size is
    full lengths along these.
    """
    half = np.asarray(size) / 2
    centre = T_sensor_object.translation.numpy()
    # Cheap first, an axis at a time: a whole scan has 100,000 points and a box a few hundred.
    reach = np.linalg.norm(half + crop.margin)
    near = np.flatnonzero(np.abs(cloud[:, 0] - centre[0]) <= reach)
    near = near[np.abs(cloud[near, 1] - centre[1]) <= reach]
    near = near[np.abs(cloud[near, 2] - centre[2]) <= reach + abs(crop.ground)]
    local = (cloud[near] - centre) @ T_sensor_object.rotation.numpy()
    low = np.asarray((-half[0] - crop.margin, -half[1] - crop.margin, -half[2] + crop.ground))
    inside = ((local >= low) & (local <= half + crop.margin)).all(axis=1)
    return near[inside]


def check_boxes(sizes: Float[np.ndarray, "b 3"], poses: SE3, where: str, cure: str) -> None:
    """Refuse boxes that no object can have.

    `sizes` are full lengths, metres; `where` and `cure` are for the error.

    Raises:
        BadInputError: a size that is not above 0 or over 1 km, a pose that is not on any map.
    """
    places = poses.matrix.numpy().reshape(-1, 16)
    sound = ((sizes > 0) & (sizes <= _LARGEST_M)).all(axis=-1)
    sound &= (np.abs(places) <= WORLD_M).all(axis=-1)  # NaN is not either
    if not sound.all():
        row = int(np.flatnonzero(~sound)[0])
        raise BadInputError(
            f"{where}: box {row} has no size or place (size {sizes[row].tolist()} m); {cure}."
        )
