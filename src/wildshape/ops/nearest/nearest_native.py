# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours on the CPU by the compiled kernel of `native/nearest.c`.

Points are sorted along a curve, queries lie in vector lanes, and blocks of targets whose box is out
of reach are left out: exact all the same, and faster than building a tree. Clouds are read where
they lie: rows must be dense, the stride between clouds is free.
"""

import ctypes

import torch
from jaxtyping import Float, Float32, Int, Int64
from torch import Tensor

from wildshape.ops.library import WIDEST, check_memory, library
from wildshape.ops.nearest.neighbours import Neighbours, as_int64, check_clouds
from wildshape.ops.threads import exact_threads


def nearest_native(
    query: Float32[Tensor, "B N 3"],
    target: Float32[Tensor, "B M 3"],
    query_sizes: Int[Tensor, "B"] | None = None,
    target_sizes: Int[Tensor, "B"] | None = None,
    level: int = WIDEST,
) -> Neighbours:
    """Exact search; `level` picks the instruction set (0 portable, 1 AVX2, 2 AVX-512).

    Raises:
        MemoryError: no room for one cloud's points a thread.
    """
    found = _room(query)
    _search(query, target, query_sizes, target_sizes, found, None, level)
    return found


def nearest_both_native(
    a: Float32[Tensor, "B N 3"],
    b: Float32[Tensor, "B M 3"],
    a_sizes: Int[Tensor, "B"] | None = None,
    b_sizes: Int[Tensor, "B"] | None = None,
    level: int = WIDEST,
) -> tuple[Neighbours, Neighbours]:
    """From a to b and from b to a; each cloud is sorted once.

    Raises:
        MemoryError: no room for one cloud's points a thread.
    """
    there, back = _room(a), _room(b)
    _search(a, b, a_sizes, b_sizes, there, back, level)
    return there, back


def _room(points: Float32[Tensor, "B n 3"]) -> Neighbours:
    return Neighbours(
        torch.empty(points.shape[:2], dtype=torch.float32, device="cpu"),
        torch.empty(points.shape[:2], dtype=torch.int64, device="cpu"),
    )


def _search(
    a: Tensor,
    b: Tensor,
    a_sizes: Tensor | None,
    b_sizes: Tensor | None,
    there: Neighbours,
    back: Neighbours | None,
    level: int,
) -> None:
    """Fill `there`, and `back` where it is wanted."""
    check_clouds(a, b, a_sizes, b_sizes)
    for points in (a, b):
        check_memory("nearest", points, torch.float32)
    a, b = _dense_rows(a), _dense_rows(b)
    a_sizes, b_sizes = as_int64(a_sizes), as_int64(b_sizes)
    failed = _kernels().wildshape_nearest(
        a.data_ptr(),
        a.stride(0),
        a_sizes.data_ptr() if a_sizes is not None else None,
        b.data_ptr(),
        b.stride(0),
        b_sizes.data_ptr() if b_sizes is not None else None,
        len(a),
        a.shape[1],
        b.shape[1],
        there.distance_squared.data_ptr(),
        there.index.data_ptr(),
        back.distance_squared.data_ptr() if back is not None else None,
        back.index.data_ptr() if back is not None else None,
        exact_threads(),
        level,
    )
    if failed:
        raise MemoryError(f"no room to search {a.shape[1]} and {b.shape[1]} points.")


class NativeDistance(torch.autograd.Function):
    """Distances from a search already done; backward gathers and scatters in one pass."""

    @staticmethod
    def forward(
        _query: Float32[Tensor, "B N 3"],
        _target: Float32[Tensor, "B M 3"],
        squared: Float32[Tensor, "B N"],
        _index: Int64[Tensor, "B N"],
    ) -> Float32[Tensor, "B N"]:
        """Square root of `squared`; the rest is kept for the gradient."""
        return squared.sqrt()

    @staticmethod
    def setup_context(ctx, inputs: tuple[Tensor, ...], output: Tensor) -> None:
        """Keep what the gradient reads."""
        query, target, _, index = inputs
        ctx.save_for_backward(query, target, index, output)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx, *gradients: Float[Tensor, "B N"]
    ) -> tuple[Tensor | None, ...]:
        """Unit vectors between the pairs, zero where a pair coincides or is absent."""
        query, target, index, distance = ctx.saved_tensors
        dense_query, dense_target = _dense_rows(query), _dense_rows(target)
        to_query, to_target = (
            torch.empty(x.shape, dtype=torch.float32, device="cpu") if wanted else None
            for x, wanted in zip((query, target), ctx.needs_input_grad[:2])
        )
        gradient, index, distance = (x.contiguous() for x in (gradients[0], index, distance))
        _kernels().wildshape_nearest_gradient(
            dense_query.data_ptr(),
            dense_query.stride(0),
            dense_target.data_ptr(),
            dense_target.stride(0),
            index.data_ptr(),
            distance.data_ptr(),
            gradient.data_ptr(),
            *index.shape,
            target.shape[1],
            to_query.data_ptr() if to_query is not None else None,
            to_target.data_ptr() if to_target is not None else None,
            exact_threads(),
        )
        return to_query, to_target, None, None


def _dense_rows(points: Float32[Tensor, "B n 3"]) -> Float32[Tensor, "B n 3"]:
    """The same points with rows of three floats one after another; a copy only if needed."""
    dense = points.stride(2) == 1 and (points.stride(1) == 3 or points.shape[1] <= 1)
    return points if dense else points.contiguous()


def _kernels() -> ctypes.CDLL:
    loaded = library()
    assert loaded is not None  # whoever calls has asked
    return loaded
