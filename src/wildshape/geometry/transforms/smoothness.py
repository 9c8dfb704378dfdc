# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How smooth a sequence of poses is: what changes from one step to the next."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.se3 import SE3


@dataclass(frozen=True)
class Smoothness:
    """Second differences of a trajectory, a scan being the unit of time: real motion and jitter.

    Attributes:
        translation_mean_m: of `|t[i+1] - 2 t[i] + t[i-1]|`.
        translation_p95_m: its 95 % quantile.
        rotation_mean_deg: angle between one step's turn and the next one's.
        rotation_p95_deg: its 95 % quantile.
    """

    translation_mean_m: float
    translation_p95_m: float
    rotation_mean_deg: float
    rotation_p95_deg: float


def smoothness(poses: SE3) -> Smoothness | None:
    """Of `(n,)` poses in time order; None for fewer than three."""
    if len(poses) < 3:
        return None
    exact = poses.to(torch.float64)
    t, R = exact.translation, exact.rotation
    shift = (t[2:] - 2 * t[1:-1] + t[:-2]).norm(dim=-1)
    turn = R[1:] @ R[:-1].mT
    zero = torch.zeros_like(t[2:])
    bend = torch.rad2deg(SE3(turn[1:] @ turn[:-1].mT, zero).angle())
    return Smoothness(*_mean_and_most(shift), *_mean_and_most(bend))


def _mean_and_most(values: Float[Tensor, "n"]) -> tuple[float, float]:
    return float(values.mean()), float(values.quantile(0.95))
