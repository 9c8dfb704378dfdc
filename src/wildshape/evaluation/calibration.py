# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether stated probabilities hold: calibration error and Brier score."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wildshape.evaluation.risk_coverage import ranks

Numbers = Sequence[float] | np.ndarray
Outcomes = Sequence[bool] | np.ndarray
BINS = 5
LEAST_BEV, HEADING_DEG = 0.7, 10.0


class Held(NamedTuple):
    """How well probabilities held.

    Attributes:
        error: mean difference of stated and true shares, in bins of equal count, surest last.
        brier: mean squared difference of probability and outcome (Brier 1950).
        constant: Brier score of the best constant, the share that came true.
    """

    error: float
    brier: float
    constant: float


def calibration(stated: Numbers, true: Outcomes, bins: int = BINS) -> Held | None:
    """Probabilities against what came true; None without any. Their order does not matter.

    Args:
        stated: 0 to 1.
        true: likewise many outcomes.
        bins: of equal count, to one; fewer where there are fewer numbers.
    """
    if not len(stated):
        return None
    p, y = np.asarray(stated, np.float64), np.asarray(true, np.float64)
    order = np.argsort(p, kind="stable")
    parts = [part for part in np.array_split(order, bins) if len(part)]
    # A bin may end among equal ones: each counts as what came true of all of them.
    _, at, count = np.unique(p, return_inverse=True, return_counts=True)
    came = (np.bincount(at, y) / count)[at]
    apart = [len(part) * abs(p[part].mean() - came[part].mean()) for part in parts]
    share = float(y.mean())
    return Held(sum(apart) / len(p), float(np.mean((p - y) ** 2)), share * (1.0 - share))


def auroc(stated: Numbers, true: Outcomes) -> float | None:
    """Area under the ROC curve: the chance that a true one is stated higher than a false one.

    None where all are true or none is.
    """
    y = np.asarray(true, bool)
    high, low = int(y.sum()), int((~y).sum())
    if not high or not low:
        return None
    return float((ranks(stated)[y].sum() - high * (high + 1) / 2) / (high * low))
