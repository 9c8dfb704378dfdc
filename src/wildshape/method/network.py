# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The network of the paper (section 4.2, METHOD 3): scan to canonical shape and pose hypotheses."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn
from torch.profiler import record_function

from wildshape.errors import BadInputError
from wildshape.method.encoders.named import Backbone, encoder_of
from wildshape.method.encoders.pcn import PCNEncoder
from wildshape.method.encoders.pcn_distinct import encode_distinct
from wildshape.method.encoders.pcn_static import encode_static
from wildshape.method.encoders.pcn_winners import encode_winners
from wildshape.method.heads import PoseDecoder, ShapeDecoder
from wildshape.method.ray_encoder import RayConfig, RayEncoder

# How codes with a gradient are computed: through the winning points (CPU), searched in float32 or
# in bfloat16; in passes of fixed shape (GPU), or those with products in bfloat16.
Encoding = Literal["winners", "winners-bf16", "static", "bf16"]


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
        selector: the pose decoder also says which branch it believes in (beyond the paper, which
            asks the label-free cost alone). False leaves it out of training and of the choice.
        mirror: the canonical shape is symmetric in its plane y = 0 (beyond the paper).
        start: half lengths, in network units, of the ellipsoid of points the shape starts from.
            Longer along x than along y, it puts a mirror plane along the object, not across.
        scale: metres of one network unit, about half an object's length; 1 in the paper.
        backbone: which point network the encoder is; the paper's is PCN's.
        neighbours: of a point, where the encoder looks at neighbourhoods (`pointnet2`, `dgcnn`);
            fewer than the 20 to 32 of their papers, for scans of few points.
        centres: of neighbourhoods in the two levels of `pointnet2`; a quarter of its paper's.
        rays: how the rays beside the object are seen, too (beyond the paper); None: not at all.
    """

    encoder: tuple[int, int, int, int] = (128, 256, 512, 1024)
    decoder: tuple[int, int] = (1024, 1024)
    pose: tuple[int, int] = (512, 128)
    points: int = 2048
    branches: int = 4
    spread: Literal["yaw", "sphere"] = "yaw"
    selector: bool = False
    mirror: bool = False
    start: tuple[float, float, float] = (0.5, 0.5, 0.5)
    scale: float = 1.0
    backbone: Backbone = "pcn"
    neighbours: int = 16
    centres: tuple[int, int] = (128, 32)
    rays: RayConfig | None = None

    def __post_init__(self) -> None:
        """Refuse what would silently give another number of points."""
        if self.mirror and self.points % 2:
            raise BadInputError(
                f"a mirrored shape needs an even number of points, not {self.points}"
            )


class Poses(NamedTuple):
    """K hypotheses of `T_sensor_canonical` a scan, sensor frame moved to the scan's centre.

    Attributes:
        rotation: proper rotations.
        translation: metres.
        log_belief: logarithm of the network's belief in each.
    """

    rotation: Float[Tensor, "B K 3 3"]
    translation: Float[Tensor, "B K 3"]
    log_belief: Float[Tensor, "B K"]

    def apply(self, canonical: Float[Tensor, "B P 3"]) -> Float[Tensor, "B K P 3"]:
        """The canonical shape under every hypothesis."""
        return canonical[:, None] @ self.rotation.mT + self.translation[:, :, None]

    def choose(self, branch: Tensor) -> "Poses":
        """One hypothesis a scan, `(B,)` indices, K = 1."""
        rows = torch.arange(branch.shape[0], device=branch.device)
        return Poses(*(part[rows, branch][:, None] for part in self))


class ShapePoseNet(nn.Module):
    """Encoder, shape decoder and pose decoder. Inputs are centred scans in metres."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        code = config.encoder[-1]
        self.encoder = encoder_of(
            config.backbone,
            config.encoder,
            neighbours=config.neighbours,
            centres=config.centres,
        )
        self.shape = ShapeDecoder(code, config.decoder, config.points, config.mirror, config.start)
        self.pose = PoseDecoder(code, config.pose, config.branches, config.spread, config.selector)
        self.rays = None if config.rays is None else RayEncoder(config.rays.widths, code)

    def encode(
        self,
        scans: Float[Tensor, "B N 3"],
        encoding: Encoding | None = None,
        rays: Float[Tensor, "B R 6"] | None = None,
    ) -> Float[Tensor, "B z"]:
        """Code of centred scans; `encoding` matters to training alone, by default as exact as fast.

        Without a gradient the encoder runs as it is, in the type of its weights, and so do others
        than PCN's with one. Rays (`ray_points`) change the codes of networks that see them.
        """
        on_winners = encoding in ("winners", "winners-bf16") and torch.is_grad_enabled()
        return self._beside(rays, self._of_scans(scans, encoding), by_winners=on_winners)

    def _of_scans(
        self, scans: Float[Tensor, "B N 3"], encoding: Encoding | None
    ) -> Float[Tensor, "B z"]:
        scaled = scans / self.config.scale
        if not torch.is_grad_enabled() or not isinstance(self.encoder, PCNEncoder):
            with record_function("wildshape: encoder dense"):
                return self.encoder(scaled)
        on_cpu = scans.device.type == "cpu"
        if encoding == "winners" or (encoding is None and on_cpu):
            return encode_winners(self.encoder, scaled)
        if encoding == "winners-bf16":
            return encode_winners(self.encoder, scaled, torch.bfloat16)
        inner = torch.bfloat16 if encoding == "bf16" else scaled.dtype
        with record_function("wildshape: encoder static"):
            return encode_static(self.encoder, scaled, inner)

    def _beside(
        self, rays: Tensor | None, code: Float[Tensor, "B z"], *, by_winners: bool = False
    ) -> Float[Tensor, "B z"]:
        """The codes with what the rays beside the objects add."""
        if rays is None or self.rays is None or not rays.shape[1]:
            return code
        at = rays[..., :3] / self.config.scale
        seen = torch.cat((at, rays[..., 3:]), dim=-1).to(code.dtype)
        return code + (self.rays.by_winners(seen) if by_winners else self.rays(seen))

    def canonical(self, code: Float[Tensor, "B z"]) -> Float[Tensor, "B P 3"]:
        """`Y_can`, metres."""
        return self.shape(code).float() * self.config.scale

    def poses(self, code: Float[Tensor, "B z"]) -> Poses:
        """`T_sensor_canonical` of every branch, in the centred frame, metres."""
        rotation, translation, logits = self.pose(code)
        return Poses(rotation, translation * self.config.scale, logits.log_softmax(-1))

    def forward(
        self,
        scans: Float[Tensor, "B N 3"],
        sizes: Int64[Tensor, "B"] | None = None,
        rays: Float[Tensor, "B R 6"] | None = None,
    ) -> tuple[
        Float[Tensor, "B P 3"],
        Float[Tensor, "B K 3 3"],
        Float[Tensor, "B K 3"],
        Float[Tensor, "B K"],
    ]:
        """Canonical shape, rotations, translations and log-beliefs: pure, for export.

        Args:
            scans: centred, metres.
            sizes: points of each that come first; all others repeat one of them. By default all.
            rays: beside each object (`ray_points`), if known.
        """
        scaled = scans / self.config.scale
        code = self.encoder(scaled) if sizes is None else self._of_distinct(scaled, sizes)
        code = self._beside(rays, code)
        poses = self.poses(code)
        return self.canonical(code), poses.rotation, poses.translation, poses.log_belief

    def _of_distinct(self, scaled: Tensor, sizes: Tensor) -> Tensor:
        """Codes, on a CPU without the points that repeat others; a GPU wants fixed shapes."""
        encoder = self.encoder
        uncompiled = encoder._compiled_call_impl is None and scaled.device.type == "cpu"
        if isinstance(encoder, PCNEncoder) and uncompiled:
            return encode_distinct(encoder, scaled, sizes)
        return encoder(scaled)
