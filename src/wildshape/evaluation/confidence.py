# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a method knows when it errs: rank correlation and the risk-coverage curve."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from jaxtyping import Float

_SHARES = 20
Stated = tuple[list[float], list[float]]


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
    doubt, errors = -_ranks(confidence), _ranks(error)
    if len(doubt) < 3 or doubt.std() == 0 or errors.std() == 0:
        return None
    return float(np.corrcoef(doubt, errors)[0, 1])


def _ranks(values: Sequence[float]) -> Float[np.ndarray, "n"]:
    """Ranks; equal values share the mean of theirs."""
    given = np.asarray(values, dtype=np.float64)
    _, place, counts = np.unique(given, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return (last - (counts - 1) / 2)[place.reshape(-1)]


def risk_coverage(confidence: Sequence[float], error: Sequence[float]) -> RiskCoverage | None:
    """The curve; equal confidences keep their mean risk. None without completions."""
    if not len(confidence):
        return None
    errors = np.asarray(error, dtype=np.float64)
    risks = _kept_risk(np.asarray(confidence, dtype=np.float64), errors)
    best = _kept_risk(-errors, errors)
    count = len(errors)
    shares = np.unique(np.ceil(np.linspace(1 / _SHARES, 1, _SHARES) * count).astype(int))
    return RiskCoverage(
        coverage=tuple(float(n / count) for n in shares),
        risk=tuple(float(risks[n - 1]) for n in shares),
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


def confidence_figures(stated: Stated) -> dict[str, float | None]:
    """The figures of `metrics.json` of completions that state a confidence."""
    confidence, error = stated
    curve = risk_coverage(confidence, error)
    return {
        "confidence_rank_correlation": rank_correlation(confidence, error),
        "risk_coverage_area": curve.area if curve else None,
    }


def risk_coverage_curves(stated: Iterable[tuple[str, Stated]]) -> dict[str, dict[str, object]]:
    """The curve of each row that states confidences, over all its runs together."""
    rows: dict[str, Stated] = {}
    for name, (confidence, error) in stated:
        known = rows.setdefault(name, ([], []))
        known[0].extend(confidence)
        known[1].extend(error)
    curves = {name: risk_coverage(*found) for name, found in rows.items()}
    return {name: asdict(curve) for name, curve in curves.items() if curve is not None}
