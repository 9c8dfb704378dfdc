# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every nearest-neighbour backend takes and returns."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int, Int64
from torch import Tensor

from wildshape.errors import BadInputError


@dataclass(frozen=True)
class Neighbours:
    """The nearest target of each query; constants for autograd.

    Attributes:
        distance_squared: `(B, N)`, the square of the query's unit; `inf` where a row has no
            target and for queries that are not finite, 0 for padding queries (so that a row's sum
            is the sum over its points).
        index: `(B, N)` into the row's targets; 0 where there is none.
    """

    distance_squared: Float[Tensor, "B N"]
    index: Int64[Tensor, "B N"]


@dataclass(frozen=True)
class Neighbourhoods:
    """The k nearest targets of each query, the nearest first.

    Attributes:
        distance_squared: `(B, N, k)`, the square of the query's unit; `inf` where there are no more
            targets, 0 for padding queries.
        index: `(B, N, k)` into the row's targets; 0 where there is none.
    """

    distance_squared: Float[Tensor, "B N k"]
    index: Int64[Tensor, "B N k"]


def check_clouds(
    query: Tensor, target: Tensor, query_sizes: Tensor | None, target_sizes: Tensor | None
) -> None:
    """Refuse what would be read past its end: types are checked under pytest alone.

    Raises:
        BadInputError: not `(B, N, 3)` and `(B, M, 3)` points, or sizes of another length.
    """
    shapes = tuple(query.shape), tuple(target.shape)
    if any(len(s) != 3 or s[2] != 3 for s in shapes) or shapes[0][0] != shapes[1][0]:
        raise BadInputError(
            f"nearest: expected clouds of shapes (B, N, 3) and (B, M, 3), found {shapes[0]} and"
            f" {shapes[1]}."
        )
    for sizes in (query_sizes, target_sizes):
        if sizes is not None and (sizes.shape != shapes[0][:1] or sizes.is_floating_point()):
            raise BadInputError(
                f"nearest: expected {shapes[0][0]} whole numbers as sizes, found"
                f" {tuple(sizes.shape)} of {sizes.dtype}."
            )


def as_int64(sizes: Int[Tensor, "B"] | None) -> Int64[Tensor, "B"] | None:
    """Sizes as the kernels read them."""
    return None if sizes is None else sizes.to("cpu", torch.int64).contiguous()


def beyond_sizes(rows: Tensor, sizes: Int[Tensor, "B"]) -> Tensor:
    """`(B, n)`: which places lie past each row's size."""
    return torch.arange(rows.shape[1], device=rows.device) >= sizes.to(rows.device)[:, None]


def check_neighbours(found: Neighbours, query: Tensor) -> None:
    """Refuse neighbours that are not those of as many queries.

    Raises:
        BadInputError: other shapes or types.
    """
    squared, index = found.distance_squared, found.index
    types = (squared.dtype, index.dtype) == (query.dtype, torch.int64)
    if not types or not squared.shape == index.shape == query.shape[:2]:
        raise BadInputError(
            f"nearest_distance: expected neighbours of {tuple(query.shape[:2])} queries, found"
            f" distances {tuple(squared.shape)} of {squared.dtype} and indices"
            f" {tuple(index.shape)} of {index.dtype}."
        )
