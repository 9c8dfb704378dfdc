# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How far a completion is to be trusted: its features, its confidence, and what speaks against it.

The features are known without labels; `method/confidence.py` makes a confidence of them. Reasons
are short names for machines (docs/formats.md). Asked of the scan: `other_sensor` (a camera's scan
for weights of LiDARs, or the reverse), `too_large_for_model` (the bounding box's diagonal is above
the largest trained on), `too_small_for_model` (below half of the smallest trained on: a scan may
show a part of an object), `few_points`, `sensor_inside` (the points lie on all sides of the
origin); three more are asked of it and its shape (`method/single_object.py`). Asked of a track:
`scans_disagree` (on its height: perhaps they are of several objects).
Asked of the result: `poor_fit` (the label-free cost is far above that of scans held out in
training), `low_confidence`, and which of the probabilities is low: `unsure_heading`, `unsure_box`,
`other_kind`. `ReasonRule` holds the bounds.
"""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.box import extent
from wildshape.geometry.projection.line_of_sight import surrounded
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import ReasonRule
from wildshape.io.progress import counted
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.confidence import COVERED_M, SMALLEST_M, ConfidenceFeatures
from wildshape.method.hindsight import Scores
from wildshape.method.network import Poses
from wildshape.method.single_object import (
    looked_down_on,
    share_off,
    share_twice,
    unseen_height,
)
from wildshape.method.trust import Calibrator, ScanFeatures, TrackFeatures
from wildshape.records import Box, Completion, Points, Registration, Sensor, SensorKind

_RULE = ReasonRule()
_LEAST_ODDS, _MOST_ODDS = 1e-3, 49.0
_FEWEST_HEIGHTS = 4
DENSEST = 40_000  # points: no calibration has seen more, and what it saw falls with them
VIEW_PX = 240.0  # focal length of the camera that calibrations saw; finer ones say no more
VIEWED_M = (1.6, 2.05)  # how far from it what it saw was; from elsewhere as if from there
OFF_AXIS = 0.5  # cosine: no depth camera sees what is farther off its axis
_CURES = {
    "points_off_shape": "cut out the object alone, without ground or what stands beside it",
    "not_one_scan": "hand in the points of one frame, seen from where its sensor stood",
    "roof_not_seen": "cut out one vehicle, without another or its trailer",
}
_OF_RESULT = ("poor_fit", "low_confidence", "unsure_heading", "unsure_box", "other_kind")


def look_features(
    scans: Float[Tensor, "B N 3"],
    posed: Float[Tensor, "B H P 3"],
    scores: Scores,
    poses: Poses,
    believed: Float[Tensor, "B H"],
) -> Float[Tensor, "B 6"]:
    """The features that a look at scans tells: all but those of the scan itself and the cost.

    Args:
        scans: centred scans.
        posed: shapes under every hypothesis.
        scores: of the hypotheses.
        poses: the hypotheses.
        believed: what decides between them, metres; the least speaks.
    """
    rows = torch.arange(len(scans), device=scans.device)
    order = believed.argsort(-1)
    first, second = order[:, 0], order[:, min(1, order.shape[1] - 1)]
    entropy = -(poses.log_belief.exp() * poses.log_belief).nan_to_num().sum(-1)
    shape = posed[rows, first]
    spread = (shape - posed[rows, second]).norm(dim=-1).mean(-1)
    found = scans.gather(1, scores.to_scan[rows, first][..., None].expand(-1, -1, 3))
    covered = ((shape - found).norm(dim=-1) < COVERED_M).float().mean(-1)
    terms = [log_of(part[rows, first]) for part in (scores.observation, scores.projection)]
    margin = believed[rows, second] - believed[rows, first]
    return torch.stack((*terms, entropy, margin, spread, covered), dim=-1)


def log_of(values: Float[Tensor, "B"]) -> Float[Tensor, "B"]:
    """Logarithm of lengths, metres; of none as of the smallest."""
    return values.clamp_min(SMALLEST_M).log()


def features_of(
    scan: Points, cost: float, seen: Float[Tensor, "6"], sensor_kind: SensorKind = "lidar"
) -> ConfidenceFeatures:
    """All features of one completion."""
    observation, projection, entropy, margin, spread, covered = seen.tolist()
    away, number = _away(scan), len(scan)
    if sensor_kind == "camera":  # as if it had stood where calibrations saw from
        nearby = min(max(away, VIEWED_M[0]), VIEWED_M[1])
        away, number = nearby, _pixels(scan, VIEW_PX * (away / nearby))
    return ConfidenceFeatures(
        log_cost=math.log(max(cost, SMALLEST_M)),
        log_observation=observation,
        log_projection=projection,
        entropy=entropy,
        margin=margin,
        spread=spread,
        log_points=math.log(min(number, DENSEST)),
        log_range=math.log(max(away, SMALLEST_M)),
        log_extent=math.log(max(extent(scan), SMALLEST_M)),
        covered=covered,
    )


def _away(scan: Points) -> float:
    """How far the middle of its points is; in float32 it would be 2 cm off of a million."""
    return float(np.linalg.norm(scan.mean(0, dtype=np.float64)))


def _pixels(scan: Points, focal_px: float) -> int:
    """How many pixels of such a camera a scan's points fill."""
    across, down = np.floor(scan[:, :2] / np.maximum(scan[:, 2:], SMALLEST_M) * focal_px).T
    return len(np.unique(across + 1j * down))


def confidence_of(features: ConfidenceFeatures, settings: ModelSettings) -> float:
    """0 to 1: as the weights are calibrated (`method/confidence.py`).

    Without a calibration it falls with the label-free cost, and is 1/2 at the held-out 90th
    percentile.
    """
    if settings.calibration is not None:
        return settings.calibration.confidence(features)
    return 1.0 / (1.0 + (math.exp(features.log_cost) / settings.cost_m[1]) ** 2)


class Glance(NamedTuple):
    """What a network's look says of a scan besides its shape; as in `Completion`."""

    pose: SE3
    confidence: float
    branch: int
    cost: float
    warning: str
    reasons: tuple[str, ...]
    features: ConfidenceFeatures
    p_pose: None = None


def glance_of(
    scan: Points,
    sensor: Sensor | None,
    pose: SE3,
    cost: float,
    branch: int,
    seen: Float[Tensor, "6"],
    settings: ModelSettings,
    rule: ReasonRule = _RULE,
) -> Glance:
    """What is to be said of a scan, from what a look found (`Found.said`).

    What a shape pays for standing where rays passed chose among the hypotheses. Scans held out and
    calibrated on had no rays, so it is no part of the cost that is compared with theirs.
    """
    features = features_of(scan, cost, seen, settings.sensor)
    fit = min(cost, math.exp(seen[0]) + settings.beta * math.exp(seen[1]))
    warning = warning_of(scan, sensor, settings, rule)
    of_fit = features._replace(log_cost=math.log(max(fit, SMALLEST_M)))
    return Glance(
        pose=pose,
        confidence=0.0 if warning else confidence_of(of_fit, settings),
        branch=branch,
        cost=fit,
        warning=warning,
        reasons=reasons_of_scan(scan, sensor, settings, rule),
        features=features,
    )


def reasons_of_scan(
    scan: Points, sensor: Sensor | None, settings: ModelSettings, rule: ReasonRule = _RULE
) -> tuple[str, ...]:
    """What speaks against the scan itself, a line a reason."""
    low, high = settings.extent_m
    size = extent(scan)
    holds = {
        "other_sensor": sensor is not None and sensor.kind != settings.sensor,
        "too_large_for_model": size > high,
        "too_small_for_model": size < rule.smallest * low,
        "few_points": len(scan) < rule.few_points,
        "sensor_inside": surrounded(scan),
    }
    return tuple(reason for reason, held in holds.items() if held)


def reasons_of_object(
    scan: Points, seen: Points, points: Points, box: Box, unit: float, rule: ReasonRule = _RULE
) -> tuple[str, ...]:
    """What speaks against a scan's being of one object alone, in short names.

    Args:
        scan: sensor frame, metres, none of its points at the sensor.
        seen: the same without the ground beside the object.
        points: of the completed shape, sensor frame.
        box: of it.
        unit: metres of the unit in which the object is as large as a vehicle.
        rule: the bounds.
    """
    far = rule.apart_m * unit
    holds = {
        "points_off_shape": share_off(scan, points, far) > rule.off_share,
        "not_one_scan": share_twice(scan, rule.alike_deg, far) > rule.twice_share,
        "roof_not_seen": looked_down_on(scan) and unseen_height(seen, box) > far,
    }
    return tuple(reason for reason, held in holds.items() if held)


def judged(
    done: Completion,
    trust: Calibrator | None,
    evidence: ScanFeatures | TrackFeatures | None,
    settings: ModelSettings,
    rule: ReasonRule = _RULE,
) -> Completion:
    """A completion with its probabilities, if there are any, and what speaks against it.

    Args:
        done: with the confidence of its cost and the reasons that its scan gives.
        trust: makes probabilities of the evidence.
        evidence: what is known of it.
        settings: of the weights.
        rule: the bounds.
    """
    found = None
    if trust is not None and evidence is not None:
        found = trust(evidence._asdict())
        found = found._replace(kind=0.0) if done.warning else found
        done = replace(
            done,
            confidence=found.product,
            p_pose=found.pose,
            p_box=found.box,
            p_kind=found.kind,
        )
    given = tuple(evidence) if evidence is not None else ()
    of_scan = tuple(reason for reason in done.reasons if reason not in _OF_RESULT)
    reasons = (*of_scan, *reasons_of_result(done, settings, rule))
    return replace(done, evidence=given, reasons=reasons)


def reasons_of_result(
    done: Completion, settings: ModelSettings, rule: ReasonRule = _RULE
) -> tuple[str, ...]:
    """What speaks against what came out, a line a reason."""
    least = rule.low_confidence if done.p_pose is None else rule.least
    holds = {
        "poor_fit": done.cost > rule.poor_fit * settings.cost_m[1],
        "low_confidence": done.confidence < least,
        "unsure_heading": done.p_pose is not None and done.p_pose < rule.least,
        "unsure_box": done.p_box is not None and done.p_box < rule.least,
        "other_kind": done.p_kind is not None and done.p_kind < rule.least,
    }
    return tuple(reason for reason, held in holds.items() if held)


def reasons_of_track(alone: Iterable[Completion], rule: ReasonRule = _RULE) -> tuple[str, ...]:
    """What speaks against scans being of one object.

    Args:
        alone: a track's scans, each completed on its own.
        rule: the bounds.
    """
    heights = [done.box.size[2] for done in alone]
    if len(heights) < _FEWEST_HEIGHTS:
        return ()
    low, middle, high = np.quantile(heights, (0.2, 0.5, 0.8))
    return ("scans_disagree",) if high - low > rule.disagree * middle else ()


def odds_of(done: Completion) -> float:
    """What a scan counts among those of its track: the odds that its heading and box are right.

    Of weights without probabilities the confidence.
    """
    if done.p_pose is None or done.p_box is None:
        return max(done.confidence, _LEAST_ODDS)
    right = 0.0 if done.warning else done.p_pose * done.p_box
    return min(max(right / max(1.0 - right, 1e-9), _LEAST_ODDS), _MOST_ODDS)


def warning_of(
    scan: Points, sensor: Sensor | None, settings: ModelSettings, rule: ReasonRule = _RULE
) -> str:
    """One sentence where the model was not made for such a scan, else nothing."""
    if sensor is not None and sensor.kind != settings.sensor:
        return f"a {sensor.kind} scan, but the model was trained on {settings.sensor} scans"
    if surrounded(scan):
        return (
            "its points lie on all sides of the origin, where no sensor can have stood: moved to"
            " its own centre? hand it in as the sensor saw it"
        )
    x, y, z = scan.mean(0, dtype=np.float64)
    if settings.sensor == "camera" and z < OFF_AXIS * math.hypot(x, y, z):
        return (
            "it lies beside or behind the camera, whose axes are x right, y down, z forward;"
            " turn the scan's axes to these"
        )
    low, high = settings.extent_m
    size = extent(scan)
    if size < rule.smallest * low or size > rule.largest * high:
        return (
            f"extent {size:.3g} m lies outside the {low:.3g} to {high:.3g} m trained on;"
            " check the unit, or train on such objects"
        )
    return ""


def reasons_sentence(done: Completion | Registration) -> str:
    """A sentence on one result that is not to be trusted, or nothing."""
    if not done.reasons:
        return ""
    why = ", ".join(map(_words, done.reasons))
    detail = f" ({advice})" if (advice := _advice(done)) else ""
    return f"this result is not to be trusted: {why}{detail}"


@dataclass
class ReasonCounts:
    """Results that are not to be trusted, and why (`reasons_of_scan`, `reasons_of_result`).

    Attributes:
        seen: results looked at.
        flagged: of them not to be trusted.
        example: the first of these, or the first with a warning or a cure, and that.
        advised: whether it has one.
        reasons: how often each speaks.
    """

    seen: int = 0
    flagged: int = 0
    example: str = ""
    advised: bool = False
    reasons: Counter[str] = field(default_factory=Counter)

    def add(self, name: str, done: Completion) -> None:
        """Look at a result."""
        self.seen += 1
        self.flagged += bool(done.reasons)
        self.reasons.update(done.reasons)
        advice = _advice(done)
        if done.reasons and (not self.example or (advice and not self.advised)):
            self.example, self.advised = f"{name}: {advice}" if advice else name, bool(advice)

    def of(self, names: Iterable[str], done: Iterable[Completion]) -> "ReasonCounts":
        """The same with more results looked at."""
        for name, one in zip(names, done, strict=True):
            self.add(name, one)
        return self

    @property
    def sentence(self) -> str:
        """How many are not to be trusted and the commonest reasons, or nothing."""
        if not self.flagged:
            return ""
        why = ", ".join(f"{_words(reason)} {n}" for reason, n in self.reasons.most_common())
        are = "is" if self.flagged == 1 else "are"
        return (
            f"{self.flagged} of {counted(self.seen, 'result')} {are} not to be trusted: {why};"
            f" for example {self.example}"
        )

    @property
    def data(self) -> dict[str, Any]:
        """The same for machines, the commonest reason first."""
        return {"flagged": self.flagged, "reasons": dict(self.reasons.most_common())}


def _advice(done: Completion | Registration) -> str:
    """The warning, or else what is to be done about the first reason that has a cure."""
    return done.warning or next((_CURES[one] for one in done.reasons if one in _CURES), "")


def _words(reason: str) -> str:
    return reason.replace("_", " ")
