# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What every nearest-neighbour backend returns."""

from dataclasses import dataclass

from jaxtyping import Float, Int64
from torch import Tensor


@dataclass(frozen=True)
class Neighbours:
    """The nearest target of each query; constants for autograd.

    Attributes:
        distance_squared: `(B, N)`, the square of the query's unit; `inf` where a row has no
            target, 0 for padding queries (so that a row's sum is the sum over its points).
        index: `(B, N)` into the row's targets; 0 where there is none.
    """

    distance_squared: Float[Tensor, "B N"]
    index: Int64[Tensor, "B N"]
