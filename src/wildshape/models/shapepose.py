# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The network of the paper (section 4.1, METHOD 3): scan to canonical shape and pose hypotheses."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from wildshape.models.heads import PoseDecoder, ShapeDecoder
from wildshape.models.pcn import PCNEncoder
from wildshape.models.pcn_winners import encode_winners


@dataclass(frozen=True)
class NetworkConfig:
    """Sizes of the network; the defaults are the paper's (METHOD 3).

    Attributes:
        encoder: widths of the encoder's four layers; the last is the code's length.
        decoder: hidden widths of the shape decoder.
        pose: hidden widths of one pose branch.
        points: m, canonical points.
        branches: K, pose hypotheses.
        spread: where the branches start, about z (`yaw`) or over all rotations (`sphere`).
        mirror: the canonical shape is symmetric in its plane y = 0 (beyond the paper).
        scale: metres of one network unit, about half an object's length; 1 in the paper.
    """

    encoder: tuple[int, int, int, int] = (128, 256, 512, 1024)
    decoder: tuple[int, int] = (1024, 1024)
    pose: tuple[int, int] = (512, 128)
    points: int = 2048
    branches: int = 4
    spread: Literal["yaw", "sphere"] = "yaw"
    mirror: bool = False
    scale: float = 1.0


class Poses(NamedTuple):
    """K hypotheses of `T_sensor_canonical` a scan, sensor frame moved to the scan's centre.

    Attributes:
        rotation: proper rotations.
        translation: metres.
    """

    rotation: Float[Tensor, "B K 3 3"]
    translation: Float[Tensor, "B K 3"]

    def apply(self, canonical: Float[Tensor, "B P 3"]) -> Float[Tensor, "B K P 3"]:
        """The canonical shape under every hypothesis."""
        return canonical[:, None] @ self.rotation.mT + self.translation[:, :, None]

    def choose(self, branch: Tensor) -> "Poses":
        """One hypothesis a scan, `(B,)` indices, K = 1."""
        rows = torch.arange(len(branch), device=branch.device)
        return Poses(self.rotation[rows, branch][:, None], self.translation[rows, branch][:, None])


class ShapePoseNet(nn.Module):
    """Encoder, shape decoder and pose decoder. Inputs are centred scans in metres."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        code = config.encoder[-1]
        self.encoder = PCNEncoder(config.encoder)
        self.shape = ShapeDecoder(code, config.decoder, config.points, config.mirror)
        self.pose = PoseDecoder(code, config.pose, config.branches, config.spread)

    def encode(self, scans: Float[Tensor, "B N 3"]) -> Float[Tensor, "B z"]:
        """Code of centred scans; training on a CPU runs through the winning points only."""
        scaled = scans / self.config.scale
        if torch.is_grad_enabled() and scans.device.type == "cpu":
            return encode_winners(self.encoder, scaled)
        return self.encoder(scaled)

    def canonical(self, code: Float[Tensor, "B z"]) -> Float[Tensor, "B P 3"]:
        """`Y_can`, metres."""
        return self.shape(code).float() * self.config.scale

    def poses(self, code: Float[Tensor, "B z"]) -> Poses:
        """`T_sensor_canonical` of every branch, in the centred frame, metres."""
        rotation, translation = self.pose(code)
        return Poses(rotation, translation * self.config.scale)

    def forward(
        self, scans: Float[Tensor, "B N 3"]
    ) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B K 3 3"], Float[Tensor, "B K 3"]]:
        """Canonical shape, rotations and translations: pure, for export."""
        code = self.encoder(scans / self.config.scale)
        return self.canonical(code), *self.poses(code)
