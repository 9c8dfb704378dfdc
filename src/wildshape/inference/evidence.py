# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is known of completions without labels, for their confidence (`method/confidence.py`)."""

import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.inference.prepare import extent
from wildshape.method.confidence import Facts
from wildshape.method.hindsight import Scores
from wildshape.method.network import Poses
from wildshape.records import Points

_COVERED_M, _SMALLEST_M = 0.2, 1e-4


def seen_facts(
    scans: Float[Tensor, "B N 3"],
    posed: Float[Tensor, "B H P 3"],
    scores: Scores,
    poses: Poses,
    believed: Float[Tensor, "B H"],
) -> Float[Tensor, "B 6"]:
    """The facts that a look at scans tells: all but those of the scan itself and the cost.

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
    covered = ((shape - found).norm(dim=-1) < _COVERED_M).float().mean(-1)
    terms = [_log(part[rows, first]) for part in (scores.observation, scores.projection)]
    margin = believed[rows, second] - believed[rows, first]
    return torch.stack((*terms, entropy, margin, spread, covered), dim=-1)


def _log(values: Float[Tensor, "B"]) -> Float[Tensor, "B"]:
    return values.clamp_min(_SMALLEST_M).log()


def facts_of(scan: Points, cost: float, seen: Float[Tensor, "6"]) -> Facts:
    """All facts of one completion."""
    observation, projection, entropy, margin, spread, covered = seen.tolist()
    return Facts(
        log_cost=math.log(max(cost, _SMALLEST_M)),
        log_observation=observation,
        log_projection=projection,
        entropy=entropy,
        margin=margin,
        spread=spread,
        log_points=math.log(len(scan)),
        log_range=math.log(max(float(np.linalg.norm(scan.mean(0))), _SMALLEST_M)),
        log_extent=math.log(max(extent(scan), _SMALLEST_M)),
        covered=covered,
    )
