# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DGCNN's encoder (Wang et al. 2019): convolutions over edges of graphs found anew in each layer.

Simpler than the original: three edge convolutions, no batch normalisation (each cloud is coded on
its own, as by PCN's encoder), a maximum at the end and no mean.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from wildshape.method.encoders.neighbourhood import first_copies, nearest_distinct

_LEAK = 0.2  # of the activation, as in the paper


class DGCNNEncoder(nn.Module):
    """Points to code: edge convolutions 3-a-b-c, all joined, one layer to d, max.

    Args:
        widths: (a, b, c, d).
        neighbours: of a point, itself among them.
    """

    def __init__(self, widths: tuple[int, int, int, int], neighbours: int) -> None:
        super().__init__()
        a, b, c, d = widths
        layers = ((3, a), (a, b), (b, c))
        self.edge1, self.edge2, self.edge3 = (EdgeConv(*sizes, neighbours) for sizes in layers)
        self.point4 = nn.Linear(a + b + c, d)

    def forward(self, points: Float[Tensor, "B N 3"]) -> Float[Tensor, "B d"]:
        """Code of each cloud; invariant to the order and repetition of its points."""
        distinct = first_copies(points)
        one = self.edge1(points, distinct)
        two = self.edge2(one, distinct)
        three = self.edge3(two, distinct)
        return self.point4(torch.cat((one, two, three), dim=-1)).amax(1)


class EdgeConv(nn.Module):
    """`max over j near i of leaky(A x_i + B (x_j - x_i) + b)`, near in the layer's own input.

    The activation rises and `A x_i - B x_i` does not depend on j: the maximum may be taken over
    `B x_j` alone, one product a point instead of one an edge.
    """

    def __init__(self, inner: int, outer: int, neighbours: int) -> None:
        super().__init__()
        self.neighbours = neighbours
        self.own = nn.Linear(inner, outer)
        self.near = nn.Linear(inner, outer, bias=False)

    def forward(
        self, features: Float[Tensor, "B N c"], distinct: Bool[Tensor, "B N"]
    ) -> Float[Tensor, "B N d"]:
        """Features of every point from its nearest ones, itself among them."""
        index = nearest_distinct(features, features, distinct, self.neighbours)
        near = self.near(features)
        return leaky_relu(self.own(features) - near + largest_near(near, index), _LEAK)


def largest_near(
    values: Float[Tensor, "B N d"], index: Int[Tensor, "B N k"]
) -> Float[Tensor, "B N d"]:
    """The largest value among the neighbours, entry by entry; the gradient goes to that one."""
    with torch.no_grad():
        winner = index[..., :1].expand_as(values)
        best = values.gather(1, winner)
        for near in index[..., 1:, None].unbind(2):  # an arg-max over a middle axis is slow
            row = near.expand_as(values)
            found = values.gather(1, row)
            winner = torch.where(found > best, row, winner)
            best = torch.maximum(best, found)
    return values.gather(1, winner)
