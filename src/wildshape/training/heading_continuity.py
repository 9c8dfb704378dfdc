# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An object does not turn around between neighbouring scans (beyond the paper).

Hindsight lets every scan pick whichever of two headings, a half turn apart, fits a near-symmetric
shape a little better, so nothing ever makes the scans of a track agree: the paper's lottery
(METHOD 12). Neighbouring scans, as recorded, do agree: their relative rotation is far below 90
degrees. Branches that would turn the object around are handicapped out of winning.
"""

import torch
from jaxtyping import Float
from torch import Tensor

_NEVER_M = 100.0


@torch.no_grad()
def turning_handicap(
    rotation: Float[Tensor, "B K 3 3"],
    turn: Float[Tensor, "B 3 3"],
    anchor: Float[Tensor, "B 3 3"],
) -> Float[Tensor, "B K"]:
    """Metres of handicap: none up to 90 degrees from the anchor, prohibitive beyond.

    Args:
        rotation: `R_sensor_canonical` of every branch of the turned scans.
        turn: rotation by which each scan was turned for training (`x_turned = turn x_recorded`).
        anchor: `R_sensor_canonical` that each scan, as recorded, is held to.
    """
    recorded = turn.mT[:, None] @ rotation
    relative = anchor[:, None].mT @ recorded
    cosine = (relative.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
    return torch.where(cosine > 0, 0.0, _NEVER_M * (1 - cosine))
