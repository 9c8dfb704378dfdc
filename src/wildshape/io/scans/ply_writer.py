# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Writing PLY: binary little endian, float32 x y z, perhaps colours."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from wildshape.io.atomic import atomic_write

_AXES = ("x", "y", "z")


def ply_bytes(
    points: Float[np.ndarray, "n 3"], colors: UInt8[np.ndarray, "n 3"] | None = None
) -> bytes:
    """A binary little-endian PLY file: float32 x y z (and uchar red green blue)."""
    fields = [(axis, "<f4") for axis in _AXES]
    lines = [f"property float {axis}" for axis in _AXES]
    if colors is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue")]
        lines += [f"property uchar {name}" for name in ("red", "green", "blue")]
    rows = np.empty(len(points), np.dtype(fields))
    for i, axis in enumerate(_AXES):
        rows[axis] = points[:, i]
    if colors is not None:
        for i, name in enumerate(("red", "green", "blue")):
            rows[name] = colors[:, i]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}", *lines]
    return ("\n".join([*header, "end_header"]) + "\n").encode() + rows.tobytes()


def write_ply(
    path: Path | str,
    points: Float[np.ndarray, "n 3"],
    colors: UInt8[np.ndarray, "n 3"] | None = None,
) -> None:
    """Write points as binary little-endian PLY, float32 x y z, atomically.

    Args:
        path: the file; its folder is made if needed.
        points: `(n, 3)`, metres.
        colors: `(n, 3)` 0 to 255, kept as uchar red green blue.
    """
    with atomic_write(path) as file:
        file.write(ply_bytes(points, colors))
