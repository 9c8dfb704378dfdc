# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A PLY file with more in it than points."""

import struct

import numpy as np

_LISTS = """ply
format {} 1.0
comment lists before, in and after the points, of different lengths
element grid 2
property list uchar int index
element vertex {}
property uchar before
property list uchar short tags
property double x
property double y
property double z
property float confidence
element face 1
property list uchar int vertex_indices
end_header
"""


def ply_with_lists(order: str, cloud: np.ndarray) -> bytes:
    """The content of a file in one of PLY's three orders."""
    head = _LISTS.format(order, len(cloud))
    if order == "ascii":
        rows = [f"9 {i % 3}{' 1' * (i % 3)} {x} {y} {z} 0.5" for i, (x, y, z) in enumerate(cloud)]
        return (head + "\n".join(["1 5", "2 6 7", *rows, "3 0 1 2"]) + "\n").encode()
    sign = "<" if "little" in order else ">"
    body = [head.encode(), struct.pack(sign + "BiBii", 1, 5, 2, 6, 7)]
    for i, point in enumerate(cloud):
        tags = [1] * (i % 3)
        body.append(struct.pack(f"{sign}BB{len(tags)}h3df", 9, len(tags), *tags, *point, 0.5))
    return b"".join((*body, struct.pack(sign + "B3i", 3, 0, 1, 2)))
