# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Planes of neighbourhoods on the CPU by the compiled kernel of `native/planes.c`."""

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.ops.library import added_kernel


def planes_native(
    points: Float[Tensor, "B P 3"], around: Int64[Tensor, "B n k"]
) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B n 3"]]:
    """Middles and unit normals, in the points' type; its twin is `planes_torch`.

    Args:
        points: clouds, on the CPU.
        around: places in the cloud of the k points of each neighbourhood.

    Raises:
        IndexError: neighbourhoods of no points, with places outside of the cloud, or of other
            clouds.
    """
    kernel = added_kernel("planes")
    assert kernel is not None  # whoever calls has asked
    (clouds, count, size), most = around.shape, points.shape[1]
    if not size:
        raise IndexError("a neighbourhood has no points.")
    if len(points) != clouds:
        raise IndexError(f"neighbourhoods are of {clouds} clouds, and there are {len(points)}.")
    check_places(around, most)
    first = most * torch.arange(clouds, device=around.device)
    places = (around + first[:, None, None]).contiguous()
    dense = points.detach().double().contiguous()
    found = dense.new_empty(2, clouds, count, 3)
    middle, normal = found
    kernel(
        dense.data_ptr(),
        places.data_ptr(),
        clouds * count,
        size,
        middle.data_ptr(),
        normal.data_ptr(),
    )
    middle, normal = found.to(points.dtype)
    return middle, normal


def check_places(places: Int64[Tensor, "*n"], count: int) -> None:
    """Refuse what would be read past its end.

    Raises:
        IndexError: a place outside of so many points.
    """
    if places.numel() and not (int(places.min()) >= 0 and int(places.max()) < count):
        raise IndexError(f"a place is outside of {count} points.")
