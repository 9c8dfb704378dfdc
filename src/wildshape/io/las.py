# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""LAS and LAZ through laspy and lazrs, in pieces: no header decides how much is allocated."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

_PIECE = 1_000_000


def read_las(path: Path) -> Float[np.ndarray, "n 3"]:
    """Points with the file's scale and offset applied, float64, in the file's unit.

    Raises:
        BadInputError: no LAS or LAZ, or a header that promises more than the file holds.
    """
    import laspy

    with laspy.open(path) as reader:
        header = reader.header
        count, present = header.point_count, path.stat().st_size - header.offset_to_point_data
        packed = header.are_points_compressed
        least = 0 if packed else count * header.point_format.size
        check_promise(path, "points", count, least, max(present, 0))
        pieces = [np.empty((0, 3))]
        for piece in reader.chunk_iterator(min(_PIECE, max(count, 1))):
            pieces.append(np.stack([np.asarray(piece[axis]) for axis in "xyz"], -1))
    points = np.concatenate(pieces)
    if len(points) != count:
        raise BadInputError(
            f"{path}: the header promises {count} points, the file holds {len(points)}: truncated; "
            "copy it again."
        )
    return points
