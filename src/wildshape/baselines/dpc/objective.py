# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How DPC, DPC-dagger and DPC-LIDAR are trained: settings and what is minimised (METHOD 9)."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TypeVar

import torch
from jaxtyping import Float
from torch import Tensor, nn

from wildshape.baselines.dpc.network import DpcConfig, DpcNet
from wildshape.baselines.dpc.silhouette import (
    Rendering,
    cheapest,
    chosen,
    common_up,
    half_turned,
    hindsight,
    nearest,
    student_loss,
)
from wildshape.baselines.dpc.viewing_volume import (
    PolarVolume,
    ahead,
    coarser,
    offsets,
    place,
    scan_image,
    to_volume,
    upwards,
)
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.training.batches.views import Batch, ViewConfig
from wildshape.training.config import OptimConfig
from wildshape.training.objectives import Objective

Judged = TypeVar("Judged")


@dataclass(frozen=True)
class DpcLoss:
    """Weights and what changes over a run; the defaults are the authors'.

    Attributes:
        sigma: of the smoothing at the first and at the last step, in 64ths of the cube.
        keep: share of the points that is projected, at the first and at the last step.
        student: weight of the student's loss.
        depth: weight of the depth image; the authors use silhouettes alone.
        half_turn: also try the best candidate turned by half about what is up; not the authors'.
    """

    sigma: tuple[float, float] = (3.0, 0.2)
    keep: tuple[float, float] = (0.07, 1.0)
    student: float = 20.0
    depth: float = 0.0
    half_turn: bool = False


@dataclass(frozen=True)
class DpcRecipe:
    """Everything that decides a run except its data and its seed.

    Attributes:
        name: of the preset.
        network: sizes, and the sensor.
        save_every: steps between two savings.
    """

    name: str
    network: DpcConfig = field(default_factory=DpcConfig)
    loss: DpcLoss = field(default_factory=DpcLoss)
    views: ViewConfig = field(default_factory=ViewConfig)
    optim: OptimConfig = field(default_factory=OptimConfig)
    save_every: int = 1000


def dpc() -> DpcRecipe:
    """The authors' numbers: a camera at a known distance, rotation only, silhouettes."""
    return DpcRecipe(
        name="dpc",
        views=ViewConfig(tracks=8, views=4, points=3096, window=20, sensor="camera"),
        optim=OptimConfig(steps=600_000, lr=1e-4, decay=1.0, decay_every=600_000),
    )


def dpc_dagger() -> DpcRecipe:
    """DPC that also predicts a translation, of up to 0.15 of the cube along each axis."""
    base = dpc()
    return replace(base, name="dpc-dagger", network=replace(base.network, reach=0.15))


def dpc_lidar() -> DpcRecipe:
    """The paper's adaptation to LiDAR: polar transform, cube of 6 m, the range given."""
    base = dpc()
    views = ViewConfig(tracks=8, views=4, points=1024, window=20, turn="facing", sensor="lidar")
    return replace(
        base, name="dpc-lidar", network=replace(base.network, volume=PolarVolume()), views=views
    )


def small(base: DpcRecipe) -> DpcRecipe:
    """Half the resolution and an eighth of the points and widths: minutes on a CPU core."""
    network = replace(base.network, image=64, voxels=32, points=1000, channels=8, code=256)
    return replace(
        base,
        name=f"{base.name}-small",
        network=network,
        loss=replace(base.loss, keep=(0.3, 1.0)),
        views=replace(base.views, tracks=4),
        optim=OptimConfig(steps=6000, lr=1e-3, decay_every=0, warmup=100),
    )


PRESETS = {recipe.name: recipe for base in (dpc(), dpc_dagger(), dpc_lidar())
           for recipe in (base, small(base))}  # fmt: skip


class DpcObjective(nn.Module):
    """The reference view's shape, posed by each view's best candidate, must look like the view."""

    def __init__(self, network: DpcNet, config: DpcLoss) -> None:
        super().__init__()
        self.network, self.config = network, config

    def forward(self, batch: Batch, share: float, generator: torch.Generator) -> Objective:
        """Loss of a batch.

        Args:
            batch: scans in the frame of a camera, or facing the object.
            share: of the run that is done, 0 to 1.
            generator: draws the points that are projected.
        """
        network = self.network
        volume, size = network.config.volume, network.config.voxels
        offset = offsets(batch.centres, volume)
        scans = batch.scans + batch.centres[:, None]
        image = scan_image(to_volume(scans, offset, volume), network.config.image)
        code = network.encode(image)
        poses = network.poses(code)
        cloud, strength = network.cloud(code[batch.reference])
        cloud = self._kept(cloud, share, generator)
        views = len(scans) // len(cloud)
        middle = volume.scale * poses.translation + ahead(offset, volume)
        rendering = Rendering(volume, size, self._sigma(share, size), self.config.depth)
        strength = strength.repeat_interleave(views, dim=0)
        each = cloud.repeat_interleave(views, dim=0)[:, None]
        observed = coarser(image, size)

        def judged(tried: Float[Tensor, "B M 4"], judge: Callable[..., Judged]) -> Judged:
            posed = place(each, rotation_from_quaternion(tried), middle[:, None], volume)
            return judge(posed, offset, observed, rendering, strength)

        tried, best = poses.candidates, None
        if self.config.half_turn:
            best = judged(tried, cheapest)
            tried = self._and_half_turned(chosen(tried, best))
        found = judged(tried, hindsight)
        teacher = chosen(tried, found.winner)
        winner = found.winner
        if best is not None:
            winner = torch.where(winner == 0, best, network.config.candidates)
        lesson = student_loss(poses.student, teacher)
        taught = lesson + student_loss(nearest(poses.candidates, teacher), teacher)
        loss = found.loss + self.config.student * taught
        terms = {
            "silhouette": found.silhouette,
            "depth": found.depth,
            "student": lesson.detach(),
        }
        return Objective(loss, terms, winner)

    def _and_half_turned(self, pose: Float[Tensor, "B 4"]) -> Float[Tensor, "B 2 4"]:
        """Each pose, and beside it the one that is opposed to it."""
        fixed = pose.detach()
        up = upwards(self.network.config.volume, fixed)
        return torch.stack((pose, half_turned(fixed, common_up(fixed, up))), dim=1)

    def _sigma(self, share: float, size: int) -> float:
        first, last = self.config.sigma
        return (first + share * (last - first)) * size / 64

    def _kept(self, cloud: Tensor, share: float, generator: torch.Generator) -> Tensor:
        """A random part of the points, larger from step to step."""
        first, last = self.config.keep
        count = round(cloud.shape[1] * (first + share * (last - first)))
        picked = torch.randperm(cloud.shape[1], generator=generator)[: max(count, 1)]
        return cloud[:, picked.to(cloud.device)]
