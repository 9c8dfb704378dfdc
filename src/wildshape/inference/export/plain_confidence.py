# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Features and confidence of completions in operations that every runtime has.

The same definitions as in `inference/confidence.py` and `method/confidence.py`; the tests hold them
against these.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.inference.confidence import DENSEST, OFF_AXIS, VIEW_PX, VIEWED_M, log_of
from wildshape.inference.config import ReasonRule
from wildshape.inference.export.plain_scores import PlainScores
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.confidence import COVERED_M, SMALLEST_M

_RULE = ReasonRule()


def look_plain(
    posed: Float[Tensor, "B H P 3"],
    scores: PlainScores,
    belief: Float[Tensor, "B H"],
    believed: Float[Tensor, "B H"],
) -> Float[Tensor, "B 6"]:
    """What a look at scans tells, in the order of `look_features`."""
    two = min(2, believed.shape[1])
    least, order = believed.topk(two, dim=-1, largest=False, sorted=True)
    first, second = order[:, :1], order[:, two - 1 :]
    entropy = -(belief.exp() * belief).sum(-1)
    spread = (_of(posed, first) - _of(posed, second)).norm(dim=-1).mean(-1)
    covered = (_of(scores.to_scan, first) < COVERED_M).float().mean(-1)
    terms = [
        log_of(part.gather(1, first)[:, 0]) for part in (scores.observation, scores.projection)
    ]
    return torch.stack((*terms, entropy, least[:, -1] - least[:, 0], spread, covered), dim=-1)


def confidence_plain(
    scans: Float[Tensor, "B N 3"],
    cost: Float[Tensor, "B"],
    seen: Float[Tensor, "B 6"],
    settings: ModelSettings,
) -> Float[Tensor, "B"]:
    """0 to 1, of scans in their sensor frames; 0 where a warning would name size or axes."""
    low, high = settings.extent_m
    size = (scans.amax(1) - scans.amin(1)).norm(dim=-1)
    usual = (size >= _RULE.smallest * low) & (size <= _RULE.largest * high)
    if settings.sensor == "camera":
        middle = scans.mean(1)
        usual = usual & (middle[:, 2] >= OFF_AXIS * middle.norm(dim=-1))
    return torch.where(usual, _foretold(scans, size, cost, seen, settings), 0.0)


def _foretold(
    scans: Tensor, size: Tensor, cost: Tensor, seen: Tensor, settings: ModelSettings
) -> Float[Tensor, "B"]:
    """`Predictor.confidence`."""
    calibration = settings.calibration
    if calibration is None:
        return 1.0 / (1.0 + (cost / settings.cost_m[1]).square())
    distance = scans.mean(1).norm(dim=-1)
    number = torch.ones_like(scans[..., 0]).sum(-1)
    if settings.sensor == "camera":
        nearby = distance.clamp(*VIEWED_M)
        distance, number = nearby, _pixels(scans, VIEW_PX * (distance / nearby))
    number = number.clamp_max(DENSEST)
    own = torch.stack((number.log(), log_of(distance), log_of(size)), dim=-1)
    features = torch.cat((log_of(cost)[:, None], seen[:, :5], own, seen[:, 5:]), dim=-1)
    foretold = calibration.bias + features @ features.new_tensor(calibration.weights)
    beyond = (foretold - math.log(calibration.within_m)) / calibration.sigma
    return 0.5 * (1.0 - torch.erf(beyond / math.sqrt(2)))


def _pixels(scans: Float[Tensor, "B N 3"], focal_px: Float[Tensor, "B"]) -> Float[Tensor, "B"]:
    """How many pixels of such cameras the points fill."""
    seen = scans[..., :2] / scans[..., 2:].clamp_min(SMALLEST_M)
    at = (seen * focal_px[:, None, None]).floor().double()
    pixels = (at[..., 0] * 2.0**20 + at[..., 1]).sort(-1).values
    return 1.0 + (pixels[:, 1:] != pixels[:, :-1]).float().sum(-1)


def _of(values: Float[Tensor, "B H *rest"], chosen: Tensor) -> Tensor:
    """One hypothesis of each scan, `(B, 1)` indices."""
    index = chosen.view(-1, 1, *(1,) * (values.ndim - 2)).expand(-1, 1, *values.shape[2:])
    return values.gather(1, index)[:, 0]
