# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points inside a labelled box, the same rule for every data set that has boxes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points


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


def points_in_box(
    cloud: Points, T_sensor_object: SE3, size: tuple[float, float, float], crop: Crop
) -> Points:
    """The points `(n, 3)` of a whole scan that belong to the box's object, in the same frame.

    Args:
        cloud: `(s, 3)` sensor frame, metres.
        T_sensor_object: of the box; origin at its CENTRE, x forward, y left, z up.
        size: full lengths along the box's own x, y, z, metres.
        crop: see there.
    """
    return cloud[rows_in_box(cloud, T_sensor_object, size, crop)]


def rows_in_box(
    cloud: Points, T_sensor_object: SE3, size: tuple[float, float, float], crop: Crop
) -> Int[np.ndarray, " n"]:
    """Which points of a whole scan `points_in_box` takes, as rows of it in rising order."""
    half = np.asarray(size) / 2
    centre = T_sensor_object.translation.numpy()
    # Cheap first, an axis at a time: a whole scan has 100,000 points and a box a few hundred.
    reach = np.linalg.norm(half + crop.margin)
    near = np.flatnonzero(np.abs(cloud[:, 0] - centre[0]) <= reach)
    near = near[np.abs(cloud[near, 1] - centre[1]) <= reach]
    local = (cloud[near] - centre) @ T_sensor_object.rotation.numpy()
    low = np.asarray((-half[0] - crop.margin, -half[1] - crop.margin, -half[2] + crop.ground))
    inside = ((local >= low) & (local <= half + crop.margin)).all(axis=1)
    return near[inside]
