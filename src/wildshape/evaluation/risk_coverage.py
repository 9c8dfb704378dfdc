# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a method knows when it errs: rank correlation and the risk-coverage curve."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class RiskCoverage:
    """Mean error of the completions that a method is surest of.

    Attributes:
        coverage: shares kept, the surest first, 0 to 1.
        risk: mean error of those kept, in the unit of the error.
        area: mean risk over all shares; that of an order by chance is the mean error.
        best_area: the same, ordered by the true error: no confidence can do better.
    """

    coverage: tuple[float, ...]
    risk: tuple[float, ...]
    area: float
    best_area: float


def rank_correlation(confidence: Sequence[float], error: Sequence[float]) -> float | None:
    """Spearman's correlation of doubt (1 - confidence) with the error: 1 orders them perfectly.

    None for fewer than three, or where one of the two never changes.
    """
    doubt, errors = -ranks(confidence), ranks(error)
    if len(doubt) < 3 or doubt.std() == 0 or errors.std() == 0:
        return None
    return float(np.corrcoef(doubt, errors)[0, 1])


def ranks(values: Sequence[float] | np.ndarray) -> Float[np.ndarray, "n"]:
    """The place of each value, from 1; equal ones share the mean of theirs."""
    _, at, count = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(count) - (count - 1) / 2)[at]


def risk_coverage(
    confidence: Sequence[float], error: Sequence[float], shares: int = 20
) -> RiskCoverage | None:
    """The curve; equal confidences keep their mean risk. None without completions.

    Args:
        confidence: of each completion.
        error: likewise.
        shares: how many points of the curve are kept, evenly over the coverage.
    """
    if not len(confidence):
        return None
    errors = np.asarray(error, dtype=np.float64)
    risks = _kept_risk(np.asarray(confidence, dtype=np.float64), errors)
    best = _kept_risk(-errors, errors)
    count = len(errors)
    kept = np.unique(np.ceil(np.linspace(1 / shares, 1, shares) * count).astype(int))
    return RiskCoverage(
        coverage=tuple(float(n / count) for n in kept),
        risk=tuple(float(risks[n - 1]) for n in kept),
        area=float(risks.mean()),
        best_area=float(best.mean()),
    )


def _kept_risk(
    confidence: Float[np.ndarray, "n"], error: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n"]:
    """Mean error of the 1, 2, ... n surest; those equally sure count with their mean."""
    _, place = np.unique(-confidence, return_inverse=True)
    place = place.reshape(-1)
    mean = np.bincount(place, error) / np.bincount(place)
    return np.cumsum(mean[np.sort(place)]) / np.arange(1, len(error) + 1)
