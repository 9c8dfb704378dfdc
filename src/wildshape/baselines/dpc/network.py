# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC's network (Insafutdinov and Dosovitskiy 2018): an image to a cloud and to several poses."""

from dataclasses import dataclass, field
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import leaky_relu, normalize

from wildshape.baselines.dpc.viewing_volume import PinholeVolume, RangeImage, Volume, beyond

# Of the authors' network: slope of its activation, width of a pose branch, side of the last map,
# and how widely the first weights are spread.
_LEAK, _BRANCH, _SMALLEST_MAP = 0.2, 32, 4
_SPREAD, _SPREAD_OF_TRANSLATION = 0.025, 0.05


@dataclass(frozen=True)
class DpcConfig:
    """Sizes; the defaults are those of the authors.

    Attributes:
        volume: the cube before the sensor.
        image: pixels along an edge of the input, a power of two from 8.
        voxels: along an edge of the volume; divides `image`.
        points: of the cloud.
        channels: of the first convolution; doubled by each that follows, to eight times.
        code: widths of the dense layers.
        candidates: K, poses of which the best is taught.
        reach: largest translation along each axis, in edges of the cube; 0: rotation only.
    """

    volume: Volume = field(default_factory=PinholeVolume)
    image: int = 128
    voxels: int = 64
    points: int = 8000
    channels: int = 16
    code: int = 1024
    candidates: int = 4
    reach: float = 0.0


class DpcPoses(NamedTuple):
    """What the pose network says of each image.

    Attributes:
        candidates: unit quaternions w, x, y, z of K rotations.
        student: that of the one which speaks after training.
        translation: shared by all, in edges of the cube, beside the cube's middle.
    """

    candidates: Float[Tensor, "B K 4"]
    student: Float[Tensor, "B 4"]
    translation: Float[Tensor, "B 3"]


class DpcNet(nn.Module):
    """A convolutional encoder, a dense decoder of points, K + 1 small pose branches."""

    def __init__(self, config: DpcConfig) -> None:
        super().__init__()
        self.config = config
        widths = _widths(config)
        self.convolutions = nn.ModuleList(
            nn.Conv2d(a, b, 5 if i == 0 else 3, stride=2, padding=2 if i == 0 else 1)
            for i, (a, b) in enumerate(zip([2, *widths], widths))
        )
        code = config.code
        self.dense = nn.Linear(widths[-1] * _SMALLEST_MAP**2, code)
        self.shape_code, self.pose_code = nn.Linear(code, code), nn.Linear(code, code)
        self.apart = nn.BatchNorm1d(code, affine=False)
        self.shape = nn.Linear(code, 3 * config.points)
        self.strength = nn.Linear(code, 1)
        self.branches = nn.ModuleList(_branch(code) for _ in range(config.candidates + 1))
        self.translation = nn.Linear(code, 3) if config.reach else None
        self._start()

    @torch.no_grad()
    def _start(self) -> None:
        """Points near the middle, translations small, as the authors start them."""
        if self.shape.weight.is_meta:  # the shapes of the weights are asked for, and no more
            return
        for module in self.modules():
            if isinstance(module, nn.Conv2d | nn.Linear):
                nn.init.kaiming_normal_(module.weight, a=_LEAK)
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        nn.init.trunc_normal_(self.shape.weight, std=_SPREAD)
        nn.init.trunc_normal_(self.strength.weight, std=_SPREAD)
        if self.translation is not None:
            nn.init.trunc_normal_(self.translation.weight, std=_SPREAD_OF_TRANSLATION)

    def encode(self, image: RangeImage) -> Float[Tensor, "B code"]:
        """Code of images `image` pixels wide: what is covered, and how near it is."""
        near = (beyond(image.depth.shape[-1]) - image.depth) * image.silhouette
        seen = torch.stack((image.silhouette, near), dim=1)
        for convolution in self.convolutions:
            seen = leaky_relu(convolution(seen), _LEAK)
        return leaky_relu(self.dense(seen.flatten(1)), _LEAK)

    def cloud(self, code: Tensor) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B"]]:
        """Canonical points in the cube of +-0.5, and the strength of their occupancy, 0 to 1."""
        hidden = leaky_relu(self.shape_code(code), _LEAK)
        points = torch.tanh(self.shape(hidden)).unflatten(-1, (-1, 3)) / 2
        return points, torch.sigmoid(self.strength(hidden))[:, 0]

    def poses(self, code: Tensor) -> DpcPoses:
        """The candidates, their student, and the translation."""
        hidden = leaky_relu(self.pose_code(self.apart(code)), _LEAK)
        spoken = torch.stack([branch(hidden) for branch in self.branches], dim=1)
        unit = normalize(spoken, dim=-1)
        shift = torch.zeros_like(unit[:, 0, :3])
        if self.translation is not None:
            shift = self.config.reach * torch.tanh(self.translation(hidden))
        return DpcPoses(unit[:, :-1], unit[:, -1], shift)


def _widths(config: DpcConfig) -> list[int]:
    """Channels of the convolutions, each of which halves the image, down to 4 pixels."""
    halvings = (config.image // _SMALLEST_MAP).bit_length() - 1
    return [config.channels * min(2**i, 8) for i in range(halvings)]


def _branch(code: int) -> nn.Sequential:
    activation = nn.LeakyReLU(_LEAK)
    hidden = (nn.Linear(code, _BRANCH), activation, nn.Linear(_BRANCH, _BRANCH), activation)
    return nn.Sequential(*hidden, nn.Linear(_BRANCH, 4))
