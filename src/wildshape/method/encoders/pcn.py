# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""PCN's encoder (METHOD 3, Yuan et al. 2018): two max-pooled shared MLPs."""

from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import relu


class PCNEncoder(nn.Module):
    """Points to code: shared MLP 3-a-b, max, joined back to each point, shared MLP 2b-c-d, max.

    The join is written as a sum: the third layer's weight on the pooled feature is applied once
    a cloud instead of once a point, which is the same product.

    Args:
        widths: (a, b, c, d); the paper's are (128, 256, 512, 1024).
    """

    def __init__(self, widths: tuple[int, int, int, int] = (128, 256, 512, 1024)) -> None:
        super().__init__()
        a, b, c, d = widths
        self.point1 = nn.Linear(3, a)
        self.point2 = nn.Linear(a, b)
        self.join_point = nn.Linear(b, c)
        self.join_pooled = nn.Linear(b, c, bias=False)
        self.point4 = nn.Linear(c, d)

    def forward(self, points: Float[Tensor, "B N 3"]) -> Float[Tensor, "B d"]:
        """Code of each cloud; invariant to the order and repetition of its points."""
        local = self.point2(relu(self.point1(points)))
        pooled = local.amax(1)
        joined = relu(self.join_point(local) + self.join_pooled(pooled)[:, None])
        return self.point4(joined).amax(1)
