# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PointNet++'s encoder (Qi et al. 2017): small PointNets on neighbourhoods, then on those again.

Neighbourhoods are the nearest distinct points of a centre and no balls: a radius would have to
know the size of objects, and the first points of a ball depend on their order. No batch
normalisation, so each cloud is coded on its own.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn.functional import relu

from wildshape.method.encoders.neighbourhood import first_copies, nearest_distinct, rows_of


class PointNet2Encoder(nn.Module):
    """Points to code: two set abstractions of widths a and b, then a shared MLP c-d and max.

    Args:
        widths: (a, b, c, d).
        centres: of neighbourhoods in the two levels.
        neighbours: of a centre.
    """

    def __init__(
        self, widths: tuple[int, int, int, int], centres: tuple[int, int], neighbours: int
    ) -> None:
        super().__init__()
        a, b, c, d = widths
        self.level1 = SetAbstraction(0, a, centres[0], neighbours)
        self.level2 = SetAbstraction(a, b, centres[1], neighbours)
        self.point3 = nn.Linear(3 + b, c)
        self.point4 = nn.Linear(c, d)

    def forward(self, points: Float[Tensor, "B N 3"]) -> Float[Tensor, "B d"]:
        """Code of each cloud; invariant to the order and repetition of its points."""
        places, features = self.level1(points, points[..., :0])
        places, features = self.level2(places, features)
        lifted = relu(self.point3(torch.cat((places, features), dim=-1)))
        return self.point4(lifted).amax(1)


class SetAbstraction(nn.Module):
    """Centres spread over the cloud, each with the maximum of an MLP over its neighbourhood.

    The MLP sees where a neighbour lies from the centre, and its features.

    Args:
        inner: length of the features.
        outer: of the new ones, and of the hidden layer.
        centres: how many; all points where there are fewer.
        neighbours: of a centre.
    """

    def __init__(self, inner: int, outer: int, centres: int, neighbours: int) -> None:
        super().__init__()
        self.centres, self.neighbours = centres, neighbours
        self.edge1 = nn.Linear(3 + inner, outer)
        self.edge2 = nn.Linear(outer, outer)

    def forward(
        self, places: Float[Tensor, "B N 3"], features: Float[Tensor, "B N c"]
    ) -> tuple[Float[Tensor, "B S 3"], Float[Tensor, "B S d"]]:
        """Places of the centres and their features."""
        chosen = farthest_points(places, self.centres)
        centres = places.gather(1, chosen[..., None].expand(-1, -1, 3))
        index = nearest_distinct(centres, places, first_copies(places), self.neighbours)
        near = rows_of(torch.cat((places, features), dim=-1), index)
        apart = near[..., :3] - centres[:, :, None]
        edges = relu(self.edge1(torch.cat((apart, near[..., 3:]), dim=-1)))
        return centres, relu(self.edge2(edges).amax(2))


@torch.no_grad()
def farthest_points(points: Float[Tensor, "B N 3"], count: int) -> Int[Tensor, "B S"]:
    """Farthest point sampling: each next point is the farthest from all before it.

    The first is the farthest from the frame's origin, so the order of the points does not matter.
    Copies come only when every distinct point was taken.
    """
    chosen = [points.square().sum(-1).argmax(-1)]
    apart = torch.full_like(points[..., 0], torch.inf)
    for _ in range(min(count, points.shape[1]) - 1):
        last = points.gather(1, chosen[-1][:, None, None].expand(-1, 1, 3))
        apart = torch.minimum(apart, (points - last).square().sum(-1))
        chosen.append(apart.argmax(-1))
    return torch.stack(chosen, dim=1)
