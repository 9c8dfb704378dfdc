# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Three probabilities of a completion: its heading, its box and its kind (beyond the paper).

Each is a logistic regression on a few named features. The coefficients are fitted where truth is
known, on simulated drives (`experiments/calibrate_confidence.py`), and travel with the weights.
Lengths are logarithms of metres; what is not known is NaN.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

USUAL_SIZES_M = ((4.3, 1.8, 1.5), (5.4, 2.1, 2.2), (7.0, 2.45, 3.1))
"""Length, width and height of cars, vans and lorries: part of what `size_off` means."""

SIZE_SPREAD = 0.15
"""By which sizes vary, a standard deviation of their logarithms: likewise."""

RIVAL_DEG = 10.0
"""Pose hypotheses that look so far elsewhere are rivals of the chosen one."""

FAR_M = 0.3
"""A rival that costs this much more is as good as none, metres."""

DEEP_M = 0.25
"""Points of a scan so far inside its box came through a window, or the box is wrong, metres."""

SURFACE_POINTS, PATCH_POINTS = 128, 12
"""Of so many points of a scan the neighbourhoods are looked at, of so many points each."""

BENT = (0.003, 0.01)
"""Where a neighbourhood is gently bent: what of its variance lies across it."""

_STEPS, _LARGEST = 50, 30.0


class Surface(NamedTuple):
    """What the surface of a scan is like where it was seen.

    Attributes:
        square: how far it stands square to the box's sides, 1/2 to 1: the mean over neighbourhoods
            of (x^4 + y^4) / (x^2 + y^2)^2 of their normals.
        rough: how thick a neighbourhood is, standard deviation across it: of ten the second most,
            logarithm of metres.
        bent: share of the neighbourhoods that are gently bent (`BENT`).
    """

    square: float
    rough: float
    bent: float


class ScanFeatures(NamedTuple):
    """What is known without labels of one completed scan.

    Attributes:
        log_cost: label-free cost.
        rival: by how much the best hypothesis of another heading costs more, metres.
        entropy: of the network's belief in its hypotheses, nats.
        log_points: logarithm of the scan's number of points.
        log_range: its distance.
        seen_length: extent of the scan along its box, a share of the box's length.
        seen_width: the same across.
        deep: share of the scan far inside the box.
        log_length: of the box.
        size_off: how far the box is from the nearest usual size, standard deviations.
        free: share of the shape where rays passed; NaN without rays.
        square: of its `Surface`.
        rough: of it.
        bent: of it.
    """

    log_cost: float
    rival: float
    entropy: float
    log_points: float
    log_range: float
    seen_length: float
    seen_width: float
    deep: float
    log_length: float
    size_off: float
    free: float
    square: float
    rough: float
    bent: float


class TrackFeatures(NamedTuple):
    """What is known without labels of one scan of a track completed together.

    Means are over the scans as each was completed alone, the fuller the heavier.

    Attributes:
        scan_cost: label-free cost of the track's shape in this scan.
        rival: mean.
        square: mean.
        rough: mean.
        bent: mean.
        own_off: mean of the scans' own `size_off`.
        length_spread: standard deviation of the lengths of the scans' own boxes, logarithms.
        log_points: of the fullest scan.
        log_range: mean.
        log_apart: how far apart the views are, as an angle at the object: root mean square from
            their mean direction, logarithm of degrees. Scans from one place tell little more than
            one of them.
        log_length: of the track's box.
        size_off: of the track's box.
    """

    scan_cost: float
    rival: float
    square: float
    rough: float
    bent: float
    own_off: float
    length_spread: float
    log_points: float
    log_range: float
    log_apart: float
    log_length: float
    size_off: float


class Chosen(NamedTuple):
    """Which features a probability is made from."""

    pose: tuple[str, ...]
    box: tuple[str, ...]
    kind: tuple[str, ...]


OF_SCAN = Chosen(
    pose=("rival", "log_cost", "entropy", "free"),
    box=(
        "log_cost", "rival", "entropy", "seen_length", "seen_width", "deep", "log_length",
        "size_off",
    ),
    kind=(
        "log_cost", "size_off", "rival", "seen_length", "seen_width", "log_points", "log_range",
        "square", "rough", "bent",
    ),
)  # fmt: skip
OF_TRACK = Chosen(
    pose=("rival", "scan_cost", "size_off", "log_apart"),
    box=("scan_cost", "rival", "length_spread", "size_off", "log_apart", "log_length"),
    kind=("own_off", "rival", "square", "rough", "bent", "log_range", "log_points"),
)


def size_off(size_m: tuple[float, float, float]) -> float:
    """How far a box is from the nearest usual size, standard deviations of the logarithms."""
    apart = np.log(np.maximum(size_m, 1e-3) / np.asarray(USUAL_SIZES_M)) / SIZE_SPREAD
    return float(np.sqrt((apart**2).sum(1).min()))


class Probabilities(NamedTuple):
    """How far a completion is to be trusted, each 0 to 1.

    Attributes:
        pose: that its heading is within 10 degrees of the truth.
        box: that its box shares at least 0.7 of the joint area with the true one, from above.
        kind: that this is an object of the kind trained on.
    """

    pose: float
    box: float
    kind: float

    @property
    def product(self) -> float:
        """That all three hold, were they independent."""
        return self.pose * self.box * self.kind


@dataclass(frozen=True)
class LogisticRegression:
    """A probability from named features.

    Attributes:
        features: their names.
        weights: log-odds for each feature's unit.
        usual: what each feature is on average; an unknown one (NaN) counts as this.
        bias: log-odds where all features are usual.
    """

    features: tuple[str, ...]
    weights: tuple[float, ...]
    usual: tuple[float, ...]
    bias: float

    def log_odds(self, known: Mapping[str, float]) -> float:
        """Before it becomes a probability; of features that hold at least those named."""
        found = self.bias
        for name, weight, usual in zip(self.features, self.weights, self.usual, strict=True):
            value = known[name]
            found += 0.0 if math.isnan(value) else weight * (value - usual)
        return min(max(found, -_LARGEST), _LARGEST)

    def __call__(self, known: Mapping[str, float]) -> float:
        """0 to 1."""
        return 1.0 / (1.0 + math.exp(-self.log_odds(known)))


@dataclass(frozen=True)
class Calibrator:
    """The three regressions; see `Probabilities`."""

    pose: LogisticRegression
    box: LogisticRegression
    kind: LogisticRegression

    def __call__(self, known: Mapping[str, float]) -> Probabilities:
        """Of one completion."""
        return Probabilities(self.pose(known), self.box(known), self.kind(known))


@dataclass(frozen=True)
class Trust:
    """What makes probabilities of features.

    Attributes:
        scan: for completions of single scans.
        track: for those of a whole track.
        fitted_on: what they were fitted on, in words.
    """

    scan: Calibrator
    track: Calibrator
    fitted_on: str = ""

    def check(self) -> None:
        """Refuse a regression that does not fit the features.

        Raises:
            ValueError: one names a feature that there is not, or has more names than weights.
        """
        for calibrator, known in ((self.scan, ScanFeatures), (self.track, TrackFeatures)):
            for line in (calibrator.pose, calibrator.box, calibrator.kind):
                unknown = set(line.features) - set(known._fields)
                if unknown or not len(line.features) == len(line.weights) == len(line.usual):
                    raise ValueError(
                        f"a probability of {len(line.features)} features has {len(line.weights)}"
                        f" weights and unknown features {sorted(unknown)}"
                    )


def fit_logistic(
    features: tuple[str, ...],
    known: Float[np.ndarray, "n f"],
    true: Bool[np.ndarray, "n"],
    ridge: float = 1.0,
) -> LogisticRegression:
    """Ridge-regularised maximum likelihood by Newton's method, features of unit variance.

    Args:
        features: names of the columns.
        known: a row a completion; NaN where unknown.
        true: whether it holds.
        ridge: what holds the weights near zero.
    """
    counted = np.maximum(np.isfinite(known).sum(0), 1)
    usual = np.nansum(known, axis=0) / counted
    width = np.sqrt(np.nansum((known - usual) ** 2, axis=0) / counted) + 1e-9
    scaled = np.nan_to_num((known - usual) / width)
    design = np.column_stack((scaled, np.ones(len(scaled))))
    held = np.append(np.full(len(features), ridge), 1e-6)
    slope = np.zeros(design.shape[1])
    for _ in range(_STEPS):
        p = 1.0 / (1.0 + np.exp(-np.clip(design @ slope, -_LARGEST, _LARGEST)))
        gradient = design.T @ (p - true) + held * slope
        curvature = (design * (p * (1 - p))[:, None]).T @ design + np.diag(held)
        slope -= np.linalg.solve(curvature, gradient)
    found = slope[:-1] / width
    return LogisticRegression(
        features, tuple(map(float, found)), tuple(map(float, usual)), float(slope[-1])
    )
