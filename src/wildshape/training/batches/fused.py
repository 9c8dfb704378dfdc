# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Single scans, each with the pose and the shape that its whole track gave it.

The trainer's reader for self-training (`pseudo_labels.py` makes the targets) and for the oracle.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.projection.ray_points import KINDS
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.method.ray_encoder import RayConfig
from wildshape.training.batches.occlusion_augmentation import (
    OcclusionConfig,
    PartlyHidden,
    partly_hidden,
)
from wildshape.training.batches.views import ViewSampler


@dataclass(frozen=True)
class DrawConfig:
    """Which scans are drawn, and what is changed of them and of their objects.

    Attributes:
        sensors: places from which its track was seen that come with a scan; each costs a z-buffer.
        larger: largest logarithm of the factor by which an object is made larger or smaller.
        axis: share by which each of its axes is stretched besides.
        reflected: share of the scans that are reflected where objects are mirror-symmetric.
        end_on_deg: a sensor within this angle of an object's axis saw that end.
        both_ends: tracks that saw both ends are drawn so many times as often.
        near_m: LiDAR scans from nearer than this are drawn more often, as their distance squared.
        near: at most so many times.
        without_rays: share of the scans whose rays are left out, so that scans alone work, too.
    """

    sensors: int = 2
    larger: float = 0.2
    axis: float = 0.08
    reflected: float = 0.5
    end_on_deg: float = 60.0
    both_ends: float = 3.0
    near_m: float = 8.0
    near: float = 4.0
    without_rays: float = 0.2
    occlusion: OcclusionConfig = field(default_factory=OcclusionConfig)


_DEFAULT = DrawConfig()
_ENDED = (0.2, 0.8)


class FusedTargets(NamedTuple):
    """What every scan of a training set is to give.

    Attributes:
        rotation: `R_sensor_canonical` of every scan of the store, as recorded; zero if unused.
        translation: of the same, metres.
        shapes: points of each used track's object, canonical frame, metres.
        sensors: places from which each used track was seen, canonical frame, metres.
        view_top: slope above which those sensors saw nothing (`field_of_view.py`), or
            infinite.
        complete: whether the shapes are whole; else only what the sensors saw is known.
    """

    rotation: Float[Tensor, "S 3 3"]
    translation: Float[Tensor, "S 3"]
    shapes: Float[Tensor, "T G 3"]
    sensors: Float[Tensor, "T O 3"]
    view_top: Float[Tensor, "T"]
    complete: bool = False


class FusedBatch(NamedTuple):
    """Centred scans, each of another track, and their targets.

    Attributes:
        scans: B clouds of n points, metres, about their own centres.
        rotation: `R_scan_canonical`, in the scan's turned and centred frame.
        translation: of the same, metres.
        shapes: target shapes, canonical frame.
        sensors: some places from which the track was seen, canonical frame.
        view_top: slope above which they saw nothing.
        rays: beside each object, in the scan's turned and centred frame (`ray_points`); R = 0 for
            networks that see none.
    """

    scans: Float[Tensor, "B N 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    shapes: Float[Tensor, "B G 3"]
    sensors: Float[Tensor, "B O 3"]
    view_top: Float[Tensor, "B"]
    rays: Float[Tensor, "B R 6"]

    def to(self, device: torch.device | str) -> "FusedBatch":
        """The same batch on a device."""
        return FusedBatch(*(part.to(device, non_blocking=True) for part in self))


class FusedSampler:
    """Draws batches of single scans; a batch depends on its seeds alone.

    Of some LiDAR scans a part is hidden (`occlusion_augmentation.py`). Every scan is stretched with
    its object (see `stretching`), turned as scans to be posed are, and rolled as configured. Where
    objects are mirror-symmetric, some of the scans are reflected: what is seen of an object's left
    side could as well be seen of its right. Tracks that saw both ends of their object are drawn
    more often, and of a LiDAR's scans those from close by, which are few and show an object like no
    others.
    """

    def __init__(
        self,
        views: ViewSampler,
        targets: FusedTargets,
        config: DrawConfig = _DEFAULT,
        *,
        mirror: bool = False,
        rays: RayConfig | None = None,
    ) -> None:
        """Sample from the sampler's tracks.

        Args:
            views: draws the scans.
            targets: of all scans.
            config: how scans are drawn and changed.
            mirror: objects are symmetric in y = 0.
            rays: how a network sees them; None: not at all.
        """
        self.views, self.targets, self.config, self.mirror = views, targets, config, mirror
        self.rays = rays
        seen = both_ends(targets.sensors, config.end_on_deg)
        share = torch.where(seen, config.both_ends, 1.0).double().numpy()
        self._share = share / share.sum()
        self._shares = [self._shares_in(scans) for scans in views.scans_of]

    def draw(self, *seed: int) -> FusedBatch:
        """The batch of these seeds: as many scans as a batch of views has."""
        rng = np.random.default_rng(seed)
        targets, scans_of = self.targets, self.views.scans_of
        count = self.views.config.tracks * self.views.config.views
        tracks = rng.choice(len(scans_of), count, p=self._share)
        rows = np.asarray([rng.choice(scans_of[track], p=self._shares[track]) for track in tracks])
        seen = [self._seen(int(scan), rng) for scan in rows]
        points = torch.stack([one.points for one in seen])
        at, chosen = torch.from_numpy(rows), torch.from_numpy(tracks)
        rotation, factors = targets.rotation[at], _factors(count, rng, self.config)
        stretch = stretching(rotation, factors)
        scans, centres, turn = self.views.turned_points(points @ stretch.mT, rng)
        translation = (turn @ stretch @ targets.translation[at][..., None])[..., 0] - centres
        places = rng.integers(targets.sensors.shape[1], size=(count, self.config.sensors))
        some = torch.from_numpy(places)
        sensors = targets.sensors[chosen[:, None], some] * factors[:, None]
        shapes = targets.shapes[chosen] * factors[:, None]
        steeper = factors[:, 2] / (factors[:, 0] * factors[:, 1]).sqrt()
        view_top = targets.view_top[chosen] * steeper
        rays = self._rays_beside(rows, seen, turn @ stretch, centres, rng)
        batch = FusedBatch(scans, turn @ rotation, translation, shapes, sensors, view_top, rays)
        if not self.mirror:
            return batch
        return reflected(batch, rng.random(count) < self.config.reflected)

    def _shares_in(self, scans: np.ndarray) -> np.ndarray | None:
        """How likely each scan of a track is drawn; None: alike."""
        if self.views.config.sensor != "lidar":
            return None
        away = self.targets.translation[torch.from_numpy(scans)].norm(dim=-1).double()
        share = ((self.config.near_m / away.clamp_min(1e-9)) ** 2).clamp(1.0, self.config.near)
        share = share.numpy()
        return share / share.sum()

    def _seen(self, scan: int, rng: np.random.Generator) -> PartlyHidden:
        """A scan of the store, or a part of it."""
        points = self.views.picked(scan, rng)
        if self.views.config.sensor != "lidar":
            return PartlyHidden(points, points[:0])
        return partly_hidden(points, rng, self.config.occlusion)

    def _rays_beside(
        self,
        scans: np.ndarray,
        seen: Sequence[PartlyHidden],
        moved: Float[Tensor, "B 3 3"],
        centres: Float[Tensor, "B 3"],
        rng: np.random.Generator,
    ) -> Float[Tensor, "B R 6"]:
        """Those of the scans' frames, as their network sees them; of some scans none."""
        if self.rays is None:
            return centres.new_zeros(len(scans), 0, 3 + KINDS)
        found = centres.new_zeros(len(scans), self.rays.count, 3 + KINDS)
        for row, left_out in enumerate(rng.random(len(scans)) < self.config.without_rays):
            rays = None if left_out else self.views.store.rays_of(int(scans[row]))
            if rays is None:
                continue
            lines = with_hidden(rays.returned, seen[row].hidden, rng, self.rays.count // 2)
            ends, starts = (torch.from_numpy(p) @ moved[row].mT for p in (lines.ends, lines.starts))
            found[row] = self.rays.seen(ends, starts, centres[row])
        return found


def with_hidden(
    rays: SightLines, hidden: Float[Tensor, "h 3"], rng: np.random.Generator, most: int
) -> SightLines:
    """Rays, and those that end before points that something hides: at some part of their way."""
    if not len(hidden):
        return rays
    points = hidden[torch.from_numpy(rng.integers(len(hidden), size=min(len(hidden), most)))]
    ended = points * float(rng.uniform(*_ENDED))
    return SightLines.joined((rays, SightLines.of_returns(ended.numpy())))


def both_ends(
    sensors: Float[Tensor, "T O 3"], end_on_deg: float = _DEFAULT.end_on_deg
) -> Bool[Tensor, "T"]:
    """Which tracks saw their object's front and its rear.

    From one end the length is a guess, and so is the middle, which is the origin: what such tracks
    teach is what their teacher believed.

    Args:
        sensors: places, canonical frame (x along the object, z up).
        end_on_deg: a sensor within this angle of the object's axis saw that end.
    """
    end_on = math.cos(math.radians(end_on_deg))
    along = torch.nn.functional.normalize(sensors[..., :2], dim=-1)[..., 0]
    return (along > end_on).any(-1) & (along < -end_on).any(-1)


def reflected(batch: FusedBatch, chosen: Bool[np.ndarray, "B"]) -> FusedBatch:
    """Some of the scans as if seen in a mirror, y reversed, and so their objects.

    With the reflection S of the scan and M of the object in y = 0, `S (R x + t) = (S R M) (M x) +
    S t`: a rotation again.
    """
    signs = torch.ones(len(batch.scans), 3)
    signs[torch.from_numpy(chosen), 1] = -1.0
    rotation = signs[:, :, None] * batch.rotation * signs[:, None]
    across = signs[:, None]
    scans, shapes, sensors = batch.scans * across, batch.shapes * across, batch.sensors * across
    translation = batch.translation * signs
    rays = torch.cat((batch.rays[..., :3] * across, batch.rays[..., 3:]), dim=-1)
    return FusedBatch(scans, rotation, translation, shapes, sensors, batch.view_top, rays)


def stretching(
    R_sensor_canonical: Float[Tensor, "B 3 3"], factors: Float[Tensor, "B 3"]
) -> Float[Tensor, "B 3 3"]:
    """The linear maps of the sensor frame that stretch objects along their own axes.

    Stretched together with the place of the sensor, an object shows the sensor the same points as
    before: what hides what does not change under an affine map. So the stretched scan is what a
    sensor would see of an object of that size.
    """
    return (R_sensor_canonical * factors[:, None]) @ R_sensor_canonical.mT


def _factors(count: int, rng: np.random.Generator, config: DrawConfig) -> Float[Tensor, "B 3"]:
    """Lengths of the stretched axes: larger or smaller as a whole, and a little out of shape."""
    whole = np.exp(rng.uniform(-config.larger, config.larger, (count, 1)))
    axes = rng.uniform(1 - config.axis, 1 + config.axis, (count, 3))
    return torch.from_numpy((whole * axes).astype("f4"))
