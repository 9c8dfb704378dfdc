# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Depth images and masks as they lie on disk, and the points behind their pixels."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Shaped

from wildshape.errors import BadInputError, load_library
from wildshape.io.guard import reading

_BYTES = {"I;16": 2, "I;16B": 2, "I": 4, "L": 1, "P": 1, "1": 1}  # a pixel, of one channel
_FREE_BYTES, _RATIO = 1 << 24, 8
_LARGEST = 0xFFFF


def read_png(path: Path, what: str) -> Shaped[np.ndarray, "h w"]:
    """The numbers in a PNG of one channel, 8 or 16 bits; of a palette its indices.

    `what` it should be, for the error: `a 16-bit depth PNG`.

    Raises:
        BadInputError: no such file, truncated, in colour, or far larger than its file.
        MissingExtraError: Pillow is not installed.
    """
    other = None if path.exists() else next(path.parent.glob(f"{path.stem}.*"), None)
    if other is not None:
        raise BadInputError(f"{other}: expected {what}; write it as {path.name}.")
    Image = load_library("PIL.Image", "depth images need Pillow", "pip install pillow")
    with reading(path, what), Image.open(path, formats=("PNG",)) as image:
        if image.mode not in _BYTES:
            raise BadInputError(f"{path}: expected {what}, found colours ({image.mode}).")
        need = image.width * image.height * _BYTES[image.mode]
        if need > _FREE_BYTES + _RATIO * path.stat().st_size:
            raise BadInputError(
                f"{path}: claims {image.width} x {image.height} pixels in "
                f"{path.stat().st_size} bytes, too many for {what}; write it again."
            )
        return np.array(image)


def read_depth_png(path: Path) -> Shaped[np.ndarray, "h w"]:
    """The numbers in a 16-bit depth PNG, in its own unit.

    Raises:
        BadInputError: as `read_png`, or of 8 bits: a picture of depths, whose numbers are none.
        MissingExtraError: Pillow is not installed.
    """
    raw = read_png(path, "a 16-bit depth PNG")
    if raw.dtype.itemsize < 2:
        raise BadInputError(
            f"{path}: holds 8 bits a pixel, expected a 16-bit depth PNG; export the depths"
            " themselves, not a picture of them."
        )
    return raw


def first_size(paths: Iterable[Path]) -> tuple[int, int]:
    """Width and height, in pixels, of the first depth image that can be read; paths: one or more.

    Raises:
        BadInputError: none can be; what is wrong with the first.
    """
    damage: list[BadInputError] = []
    for path in paths:
        try:
            height, width = read_depth_png(path).shape
        except BadInputError as error:
            damage.append(error)
        else:
            return width, height
    raise damage[0]


def measured(raw: Shaped[np.ndarray, "h w"]) -> Shaped[np.ndarray, "h w"]:
    """The numbers of a depth PNG, 0 where the camera wrote the largest: beyond what it can say."""
    return np.where(raw < _LARGEST, raw, 0)


def supported(
    depth: Float[np.ndarray, "h w"], inside: Bool[np.ndarray, "h w"], jump: float
) -> Bool[np.ndarray, "h w"]:
    """The pixels inside a mask that lie on a surface, not between two.

    A pixel is kept that has at least three of its eight neighbours inside the mask within
    `jump` times its own depth: a corner has three. One that hangs between an object's edge and
    what is behind it has fewer.

    Args:
        depth: metres.
        inside: the mask, without pixels that have no depth.
        jump: largest step between neighbours on one surface, as a share of the depth.
    """
    rows, columns = depth.shape
    padded = np.pad(np.where(inside, depth, np.nan), 1, constant_values=np.nan)
    count = np.zeros(depth.shape, np.int64)
    for down in range(3):
        for right in range(3):
            beside = padded[down : down + rows, right : right + columns]
            count += np.abs(beside - depth) <= jump * depth
    return inside & (count >= 4)  # itself is one of them
