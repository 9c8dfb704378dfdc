# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How far a completion can be trusted, from what is known without labels (beyond the paper).

A line through a few such features foretells the Chamfer distance. Its coefficients are fitted where
truth is known, on simulated drives, and travel with the weights; without them the confidence falls
with the label-free cost alone.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

COVERED_M = 0.2
"""How near to its scan a point of a shape counts as seen, metres: part of what `covered` means."""

SMALLEST_M = 1e-4
"""Lengths below this count as this where their logarithm is taken."""

_RIDGE_OF_COST = 1e-3  # the cost orders errors well by itself
_MOST = 700.0  # the logarithm of the largest float, nearly


class ConfidenceFeatures(NamedTuple):
    """What is known of a completion without labels; numbers that grow or fall with its error.

    Attributes:
        log_cost: logarithm of the label-free cost, metres.
        log_observation: of its first term.
        log_projection: of its second term.
        entropy: of the belief in the branches, nats.
        margin: cost of the second best branch less that of the chosen one, metres.
        spread: mean distance between the shape's points under these two branches, metres.
        log_points: logarithm of the number of points of the scan.
        log_range: of the distance of its points' mean, metres.
        log_extent: of the diagonal of its bounding box, metres.
        covered: share of the shape that lies within 0.2 m of the scan.
    """

    log_cost: float
    log_observation: float
    log_projection: float
    entropy: float
    margin: float
    spread: float
    log_points: float
    log_range: float
    log_extent: float
    covered: float


@dataclass(frozen=True)
class Calibration:
    """From features to the probability that the Chamfer distance is at most `within_m`.

    Attributes:
        weights: of `ConfidenceFeatures`, in their order, for the logarithm of the Chamfer distance.
        bias: added to it.
        sigma: standard deviation of what the line does not explain.
        within_m: a good completion's Chamfer distance, metres: the median where it was fitted.
        fitted_on: what it was fitted on, in words.
    """

    weights: tuple[float, ...]
    bias: float
    sigma: float
    within_m: float
    fitted_on: str = ""

    def expected(self, features: ConfidenceFeatures) -> float:
        """The Chamfer distance that the features let expect, metres."""
        return math.exp(min(self._line(features), _MOST))

    def confidence(self, features: ConfidenceFeatures) -> float:
        """0 to 1: the probability that the Chamfer distance is at most `within_m`."""
        beyond = (self._line(features) - math.log(self.within_m)) / self.sigma
        return 0.5 * math.erfc(beyond / math.sqrt(2))

    def _line(self, features: ConfidenceFeatures) -> float:
        return self.bias + sum(w * f for w, f in zip(self.weights, features, strict=True))


def fit_calibration(
    features: Sequence[ConfidenceFeatures],
    cd: Float[np.ndarray, "n"],
    fitted_on: str = "",
    ridge: float = 1.0,
) -> Calibration:
    """Ridge regression of the logarithm of true Chamfer distances.

    Args:
        features: of completions.
        cd: their true Chamfer distances, metres.
        fitted_on: what they are, in words.
        ridge: what holds the weights of all features but the cost near zero.
    """
    known = np.asarray(features, dtype=np.float64)
    target = np.log(np.maximum(cd, 1e-6))
    middle, width = known.mean(0), known.std(0) + 1e-6
    scaled = (known - middle) / width
    held = np.full(scaled.shape[1], ridge)
    held[ConfidenceFeatures._fields.index("log_cost")] = min(ridge, _RIDGE_OF_COST)
    normal = scaled.T @ scaled + np.diag(held)
    slope = np.linalg.solve(normal, scaled.T @ (target - target.mean()))
    left = target - target.mean() - scaled @ slope
    weights = slope / width
    return Calibration(
        weights=tuple(float(w) for w in weights),
        bias=float(target.mean() - middle @ weights),
        sigma=max(float(left.std()), 1e-3),
        within_m=float(np.median(cd)),
        fitted_on=fitted_on,
    )
