# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which of an object's views look the other way, where views come in no order (beyond the paper).

What one view saw of an object must lie, seen from where another was taken, inside the object's
outline there and not in front of its surface. If one of the two is turned by a half turn, a nose
sticks out where the other saw free space. Every pair has a say, as much as turning one of the two
changes that. A problem of signs (Z2 synchronisation), as `headings.py` has them. How near
the views lie to each other would say nothing: opposite sides lie nearest when one is turned.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.surface import mirrored
from wildshape.inference.tracks.heading_vote import half_turn
from wildshape.ops.nearest import nearest

_SMALLEST_M = 1e-9


@dataclass(frozen=True)
class OverlapConfig:
    """How views contradict each other.

    Attributes:
        far: a point counts for no more than this share of the object's diagonal; poses err, too.
    """

    far: float = 0.1


_DEFAULT = OverlapConfig()


@torch.no_grad()
def agreeing_signs(
    clouds: Float[Tensor, "V n 3"],
    sensors: Float[Tensor, "V 3"],
    middle_x: float = 0.0,
    config: OverlapConfig = _DEFAULT,
    *,
    mirror: bool,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each view: turn those of -1 about the object's middle, none contradicts another.

    Args:
        clouds: points of each view in the object frame, by the pose that it found for itself,
            right but for half turns.
        sensors: where each was taken, the same frame.
        middle_x: of the object's length, there.
        config: what counts.
        mirror: the object is symmetric in the plane y = 0.
    """
    size = clouds.flatten(0, 1)
    far = config.far * float((size.amax(0) - size.amin(0)).norm()) + _SMALLEST_M
    seen = mirrored(clouds) if mirror else clouds
    turned = half_turn(middle_x, clouds.dtype).apply(seen)
    rows = [
        _contradiction(turned, cloud, sensor, far) - _contradiction(seen, cloud, sensor, far)
        for cloud, sensor in zip(clouds, sensors)
    ]
    votes = torch.stack(rows)
    votes = (votes + votes.T).fill_diagonal_(0.0)
    leading = torch.linalg.eigh(votes).eigenvectors[:, -1]
    return torch.where(leading < 0, -torch.ones_like(leading), 1.0)


def _contradiction(
    clouds: Float[Tensor, "V m 3"],
    view: Float[Tensor, "n 3"],
    sensor: Float[Tensor, "3"],
    far: float,
) -> Float[Tensor, "V"]:
    """How far points of each cloud lie, on average, in space that a view saw to be free.

    Beside the outline or in front of the surface, whichever is more; metres, at most `far` a point.
    """
    other, own = clouds - sensor, view - sensor
    distance, known = other.norm(dim=-1), own.norm(dim=-1).clamp_min(_SMALLEST_M)
    rays = other / distance.clamp_min(_SMALLEST_M)[..., None]
    found = nearest(rays, (own / known[:, None]).expand(len(clouds), -1, -1))
    beside = distance * found.distance_squared.sqrt()
    before = known[found.index] - distance
    return torch.maximum(beside, before).clamp(0.0, far).mean(-1)
