# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The two decoders (METHOD 3): canonical shape, and K hypotheses of the pose."""

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import relu

from wildshape.geometry.transforms.rotation import (
    random_rotation,
    rotation_from_6d,
    rotation_to_6d,
    rotation_z,
)


class ShapeDecoder(nn.Module):
    """Code to `(m, 3)` canonical points, a 3-layer MLP.

    Args:
        code: length of the code.
        widths: of the two hidden layers.
        points: m; even if `mirror`.
        mirror: decode m / 2 points and reflect them in the canonical plane y = 0.
        start: half lengths of the ellipsoid that the points fill before training.
    """

    def __init__(
        self,
        code: int,
        widths: tuple[int, int],
        points: int,
        mirror: bool,
        start: tuple[float, float, float],
    ) -> None:
        super().__init__()
        self.mirror = mirror
        self.layer1 = nn.Linear(code, widths[0])
        self.layer2 = nn.Linear(widths[0], widths[1])
        self.layer3 = nn.Linear(widths[1], 3 * (points // 2 if mirror else points))
        # Made once: a tensor made of numbers in every pass would be a copy that a GPU waits for.
        self.register_buffer("reflection", torch.tensor((1.0, -1.0, 1.0)), persistent=False)
        self._start_as_ellipsoid(start)

    @torch.no_grad()
    def _start_as_ellipsoid(self, half: tuple[float, float, float]) -> None:
        """Points spread over a volume from the start, so that every one has work to do."""
        if self.layer3.bias.is_meta:  # the shapes of the weights are asked for, and no more
            return
        count = self.layer3.out_features // 3
        direction = nn.functional.normalize(torch.randn(count, 3), dim=-1)
        radius = torch.rand(count, 1) ** (1 / 3)
        self.layer3.bias.copy_((torch.tensor(half) * direction * radius).flatten())

    def forward(self, code: Float[Tensor, "B z"]) -> Float[Tensor, "B P 3"]:
        """Canonical points, in units of the network's scale."""
        points = self.layer3(relu(self.layer2(relu(self.layer1(code))))).unflatten(-1, (-1, 3))
        if not self.mirror:
            return points
        return torch.cat((points, points * self.reflection), dim=1)


class PoseDecoder(nn.Module):
    """Code to K rotations and translations, one 3-layer MLP a branch, all in one product.

    Args:
        code: length of the code.
        widths: of the two hidden layers of a branch.
        branches: K.
        spread: where the branches start: `yaw`, turned evenly about z, or `sphere`, drawn from
            SO(3).
        selector: also give each branch a logit, the network's own belief in it.
    """

    def __init__(
        self, code: int, widths: tuple[int, int], branches: int, spread: str, selector: bool
    ) -> None:
        super().__init__()
        a, b = widths
        self.branches = branches
        self.layer1 = nn.Linear(code, branches * a)
        self.weight2 = nn.Parameter(torch.empty(branches, a, b))
        self.bias2 = nn.Parameter(torch.zeros(branches, 1, b))
        out = 10 if selector else 9
        self.weight3 = nn.Parameter(torch.empty(branches, b, out))
        self.bias3 = nn.Parameter(torch.zeros(branches, 1, out))
        self._start_spread(spread)

    @torch.no_grad()
    def _start_spread(self, spread: str) -> None:
        if self.weight2.is_meta:
            return
        _, a, b = self.weight2.shape
        self.weight2.normal_().mul_((2 / a) ** 0.5)
        self.weight3.normal_().mul_(0.3).div_(b**0.5)
        turns = torch.arange(self.branches) * (2 * torch.pi / self.branches)
        generator = torch.Generator().manual_seed(0)
        start = rotation_z(turns) if spread == "yaw" else random_rotation(self.branches, generator)
        self.bias3[:, 0, :6] = rotation_to_6d(start)

    def forward(
        self, code: Float[Tensor, "B z"]
    ) -> tuple[Float[Tensor, "B K 3 3"], Float[Tensor, "B K 3"], Float[Tensor, "B K"]]:
        """Rotation and translation of `T_sensor_canonical`, in the scan's centred frame; logits.

        Without a selector the logits are zero: every branch is as likely as the next.
        """
        hidden = relu(self.layer1(code)).unflatten(-1, (self.branches, -1)).transpose(0, 1)
        hidden = relu(torch.baddbmm(self.bias2, hidden, self.weight2))
        out = torch.baddbmm(self.bias3, hidden, self.weight3).transpose(0, 1).float()
        logits = out[..., 9] if out.shape[-1] > 9 else torch.zeros_like(out[..., 0])
        return rotation_from_6d(out[..., :6]), out[..., 6:9], logits
