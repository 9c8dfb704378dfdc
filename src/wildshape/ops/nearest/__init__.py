# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours: the one door. Backends lie beside it and promise the same results.

`native` (compiled C) on the CPU, `triton` on CUDA, `torch` wherever those are absent, and
`reference` for types other than float32. `WILDSHAPE_NEAREST=torch|native` forces one on the CPU.
"""

import math
import os
from importlib.util import find_spec
from typing import Literal, get_args

import torch
from jaxtyping import Float, Int, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.ops.library import added_kernel, library
from wildshape.ops.nearest.nearest_k import (
    check_k,
    nearest_k_native,
    nearest_k_torch,
    nearest_k_trees,
)
from wildshape.ops.nearest.nearest_native import NativeDistance, nearest_both_native, nearest_native
from wildshape.ops.nearest.nearest_torch import nearest_blocked, nearest_reference
from wildshape.ops.nearest.neighbours import (
    Neighbourhoods,
    Neighbours,
    check_clouds,
    check_neighbours,
)

__all__ = [
    "Backend",
    "Neighbourhoods",
    "Neighbours",
    "backend",
    "nearest",
    "nearest_both",
    "nearest_distance",
    "nearest_k",
]

Backend = Literal["native", "triton", "torch", "reference"]
_VARIABLE = "WILDSHAPE_NEAREST"


def nearest(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
) -> Neighbours:
    """The nearest target of each query, ties to the smallest index; no gradient.

    Args:
        query: `(B, N, 3)` points.
        target: `(B, M, 3)` points in the same frame, unit, type and device.
        query_sizes: `(B,)` points in use a row, the rest is padding; all if None.
        target_sizes: the same for the targets.

    Returns:
        Squared distances (inf where a row has no target, 0 for padding) and indices. A point with
        a coordinate that is not finite finds nothing (inf, index 0) and is never found.

    Raises:
        BadInputError: shapes that do not fit; WILDSHAPE_NEAREST names no backend, or one that is
            not built.
    """
    query, target = _at_least_float32(query.detach()), _at_least_float32(target.detach())
    arguments = (query, target, query_sizes, target_sizes)
    match _backend_for(query, target):
        case "native":
            return nearest_native(*arguments)
        case "triton":
            from wildshape.ops.nearest.nearest_triton import nearest_triton

            return nearest_triton(*arguments)
        case "torch":
            return nearest_blocked(*arguments)
        case _:
            return nearest_reference(*arguments)


def nearest_both(
    a: Float[Tensor, "B N 3"],
    b: Float[Tensor, "B M 3"],
    a_sizes: Int[Tensor, "B"] | None = None,
    b_sizes: Int[Tensor, "B"] | None = None,
) -> tuple[Neighbours, Neighbours]:
    """`nearest` from a to b and from b to a."""
    a, b = _at_least_float32(a.detach()), _at_least_float32(b.detach())
    if _backend_for(a, b) == "native":
        return nearest_both_native(a, b, a_sizes, b_sizes)
    return nearest(a, b, a_sizes, b_sizes), nearest(b, a, b_sizes, a_sizes)


def nearest_k(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    k: int,
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
    *,
    groups: tuple[Int64[Tensor, "B N"], Int64[Tensor, "B M"]] | None = None,
    most: float = math.inf,
) -> Neighbourhoods:
    """The k nearest targets of each query, no gradient.

    Of equal ones the native kernels give the smaller index first, torch and k-d trees any.

    Args:
        query: `(B, N, 3)` points.
        target: `(B, M, 3)` points in the same frame, unit, type and device.
        k: how many; on the CPU best below 32.
        query_sizes: `(B,)` points in use a row, the rest is padding; all if None.
        target_sizes: the same for the targets.
        groups: of queries and targets: those of a query's own group are left out.
        most: targets farther away are not found.

    Raises:
        BadInputError: shapes that do not fit.
    """
    query, target = _at_least_float32(query.detach()), _at_least_float32(target.detach())
    check_k(query, target, k, groups)
    given = (query, target, k, query_sizes, target_sizes)
    if _backend_for(query, target) == "native" and added_kernel("nearest_k"):
        return nearest_k_native(*given, groups, most)
    finite = bool(query.isfinite().all()) and bool(target.isfinite().all())
    if query.device.type == "cpu" and groups is None and finite:
        return nearest_k_trees(*given, most)
    return nearest_k_torch(*given, groups, most)


def nearest_distance(
    query: Float[Tensor, "B N 3"],
    target: Float[Tensor, "B M 3"],
    neighbours: Neighbours | None = None,
) -> Float[Tensor, "B N"]:
    """Euclidean distance of each query to its nearest target, differentiable in both.

    The choice of the neighbour is a constant; the gradient at distance zero is zero.

    Args:
        query: `(B, N, 3)` points.
        target: `(B, M, 3)` points.
        neighbours: what `nearest(query, target, ...)` gave for these very points; searched here
            if None.

    Returns:
        `(B, N)` distances; inf where a row has no target and for queries that are not finite, 0
        for padding; all these without gradient.

    Raises:
        BadInputError: shapes that do not fit.
    """
    query, target = _at_least_float32(query), _at_least_float32(target)
    found = nearest(query, target) if neighbours is None else neighbours
    check_clouds(query, target, None, None)
    check_neighbours(found, query)
    if target.shape[1] == 0:
        return found.distance_squared
    if _backend_for(query, target) == "native":
        return NativeDistance.apply(query, target, found.distance_squared, found.index)  # pyright: ignore[reportReturnType]
    chosen = target.gather(1, found.index[..., None].expand(-1, -1, 3))
    apart = found.distance_squared.isfinite() & (found.distance_squared > 0)
    # Chosen before it is squared, lest the gradient of what is not finite be 0 * inf.
    squared = torch.where(apart[..., None], query - chosen, 1.0).square().sum(-1)
    distance = squared.clamp_min(torch.finfo(squared.dtype).tiny).sqrt()
    return torch.where(apart, distance, found.distance_squared)


def backend(device: torch.device | str = "cpu") -> Backend:
    """Which implementation answers for float32 points on this device."""
    if torch.device(device).type == "cuda":
        return "triton" if find_spec("triton") else "torch"
    if torch.device(device).type != "cpu":
        return "torch"
    forced = os.environ.get(_VARIABLE, "")
    if forced and forced not in get_args(Backend):
        raise BadInputError(f"{_VARIABLE}={forced} is none of torch, native, reference.")
    if forced == "native" and library() is None:
        raise BadInputError(f"{_VARIABLE}=native, but the native library was not built.")
    if forced in ("torch", "reference", "native"):
        return forced
    return "native" if library() else "torch"


def _at_least_float32(points: Tensor) -> Tensor:
    """Half types are searched in float32: distances in them would tie or overflow."""
    return points.float() if points.dtype in (torch.float16, torch.bfloat16) else points


def _backend_for(query: Tensor, target: Tensor) -> Backend:
    if query.dtype != torch.float32 or target.dtype != torch.float32:
        return "reference"
    return backend(query.device)
