# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a file's numbers can be, for every reader alike: returns of a sensor, boxes of objects."""

import numpy as np
from jaxtyping import Bool, Float

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3

_FARTHEST_M = 1000.0
_LARGEST_M = 1000.0
_WORLD_M = 1e8  # of a map's coordinates


def measured(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Which rows are returns of a sensor at the origin: finite, and no farther than 1 km."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(points) <= _FARTHEST_M).all(axis=1))


def check_boxes(sizes: Float[np.ndarray, "b 3"], poses: SE3, where: str, cure: str) -> None:
    """Refuse boxes that no object can have.

    Args:
        sizes: full lengths, metres.
        poses: one a box.
        where: the file, for the error.
        cure: what to do, for the error.

    Raises:
        BadInputError: a size that is not above 0 or over 1 km, a pose that is not finite.
    """
    places = poses.matrix.numpy().reshape(-1, 16)
    sound = ((sizes > 0) & (sizes <= _LARGEST_M)).all(axis=-1) & np.isfinite(places).all(axis=-1)
    sound &= (np.abs(places) <= _WORLD_M).all(axis=-1)
    if not sound.all():
        row = int(np.flatnonzero(~sound)[0])
        raise BadInputError(
            f"{where}: box {row} has no size or place (size {sizes[row].tolist()} m); {cure}."
        )
