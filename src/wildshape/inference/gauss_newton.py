# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pose and size of completions fitted to their scans, all scans of a batch together.

Nine numbers a scan (rotation, translation and a stretch along the canonical axes) by Gauss-Newton,
each scan point to the plane of the shape around it; the network's answer is the prior, and that a
LiDAR is held level, to a degree, where it nearly is. One side of a car tells its heading to a
fraction of a degree, but its pitch and roll to one or two.
"""

import math
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.geometry.surface import planes
from wildshape.geometry.transforms.rotation import cross_matrix, rotation_from_vector
from wildshape.inference.config import RefineConfig
from wildshape.ops.nearest import nearest, nearest_k

_DEFAULT = RefineConfig()


class Clouds(NamedTuple):
    """Scans of different sizes, padded.

    Attributes:
        points: what lies past a scan's size is padding.
        sizes: of the scans.
    """

    points: Float[Tensor, "B n 3"]
    sizes: Int64[Tensor, "B"]

    @property
    def counted(self) -> Bool[Tensor, "B n"]:
        """Which points are no padding."""
        places = torch.arange(self.points.shape[1], device=self.points.device)
        return places < self.sizes[:, None]


class Fit(NamedTuple):
    """Where the shapes lie in their scans: `T_scan_canonical`, and the stretch before it."""

    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    stretch: Float[Tensor, "B 3"]

    def seen(self, points: Float[Tensor, "B n 3"]) -> Float[Tensor, "B n 3"]:
        """Scan points in the canonical frame, of the stretched shape."""
        return (points - self.translation[:, None]) @ self.rotation

    def unstretched(self, points: Float[Tensor, "B n 3"]) -> Float[Tensor, "B n 3"]:
        """The same, of the shape as the network gave it."""
        return self.seen(points) / self.stretch[:, None]


def fit_to_scans(
    scans: Clouds,
    shapes: Float[Tensor, "B P 3"],
    rotation: Float[Tensor, "B 3 3"],
    translation: Float[Tensor, "B 3"],
    up: Float[Tensor, "3"] | None = None,
    config: RefineConfig = _DEFAULT,
) -> Fit:
    """The fit of each scan, or the start where its scan lies farther from the shape then.

    Args:
        scans: float64, sensor frames.
        shapes: canonical frame, one a scan.
        rotation: to start from, of `T_scan_canonical`.
        translation: of the same.
        up: canonical direction in which the scans' z axes point if they were taken level.
        config: how it is fitted.
    """
    start = Fit(rotation.double(), translation.double(), torch.ones_like(translation).double())
    found, motion = start, scans.points.new_zeros(len(scans.points), 9)
    matched = scans.points, scans.points
    for step in range(config.iterations):
        if step in config.matched_at:
            local = found.unstretched(scans.points).float()
            around = nearest_k(local, shapes.float(), config.plane_points, scans.sizes).index
            matched = planes(shapes, around)
        A, b = _equations(found.seen(scans.points), *matched, found.stretch, scans.counted, config)
        A, b = _with_prior(A, b, motion, config)
        if up is not None:
            A, b = _with_level(A, b, found.rotation[:, 2], up, config)
        change = -torch.linalg.solve(A, b)
        motion = motion + change
        R = found.rotation @ rotation_from_vector(change[:, :3]).mT
        t = found.translation - (R @ change[:, 3:6, None])[..., 0]
        found = Fit(R, t, motion[:, 6:].exp())
    worse = _off(scans, shapes, found, config) > _allowed(scans, shapes, start, up, config)
    return Fit(
        *(torch.where(worse.view(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(found, start))
    )


def _off(scans: Clouds, shapes: Tensor, fit: Fit, config: RefineConfig) -> Float[Tensor, "B"]:
    """Mean distance of scan points to the shape, each at most `kernel_m`."""
    found = nearest(fit.unstretched(scans.points).float(), shapes.float(), scans.sizes)
    apart = found.distance_squared.sqrt().clamp_max(config.kernel_m)  # of padding 0
    return apart.double().sum(1) / scans.sizes


def _allowed(
    scans: Clouds, shapes: Tensor, start: Fit, up: Tensor | None, config: RefineConfig
) -> Float[Tensor, "B"]:
    """How far from the shape a scan may lie: no farther than before, or than a level one may."""
    before = _off(scans, shapes, start, config)
    if up is None:
        return before
    askew = (start.rotation[:, 2] - up).norm(dim=-1) > math.radians(config.level_deg)
    return torch.where(askew, before * config.level_may_cost, before)


def _equations(
    local: Float[Tensor, "B n 3"],
    middle: Float[Tensor, "B n 3"],
    normal: Float[Tensor, "B n 3"],
    stretch: Float[Tensor, "B 3"],
    counted: Bool[Tensor, "B n"],
    config: RefineConfig,
) -> tuple[Float[Tensor, "B 9 9"], Float[Tensor, "B 9"]]:
    """A and b of a Gauss-Newton step, A x = -b, of the nine numbers, as the scans tell them."""
    at = middle * stretch[:, None]
    across = torch.nn.functional.normalize(normal / stretch[:, None], dim=-1)
    off = local - at
    residual = (off * across).sum(-1)
    kernel = (1 + off.square().sum(-1) / config.kernel_m**2) ** -2 * counted  # Geman-McClure
    share = config.effective_points / counted.sum(1, keepdim=True) / config.error_m**2
    rows = torch.cat((torch.linalg.cross(local, across), across, -across * at), dim=-1)
    weighted = rows * (kernel * share)[..., None]
    return weighted.mT @ rows, (weighted * residual[..., None]).sum(1)


def _with_prior(
    A: Float[Tensor, "B 9 9"], b: Float[Tensor, "B 9"], motion: Tensor, config: RefineConfig
) -> tuple[Tensor, Tensor]:
    """`motion` is how far the nine numbers are from the network's answer."""
    prior = (math.radians(config.prior_deg), config.prior_m, config.prior_stretch)
    trust = A.new_tensor(prior).repeat_interleave(3) ** -2
    return A + torch.diag(trust), b + trust * motion


def _with_level(
    A: Float[Tensor, "B 9 9"],
    b: Float[Tensor, "B 9"],
    now: Float[Tensor, "B 3"],
    up: Float[Tensor, "3"],
    config: RefineConfig,
) -> tuple[Tensor, Tensor]:
    """What a level sensor adds for the rotation: `now` is its z axis, canonical frame."""
    off = now - up
    level, tilted = math.radians(config.level_deg), math.radians(config.tilted_deg)
    kernel = (1 + off.square().sum(-1) / tilted**2) ** -2  # Geman-McClure
    across = -cross_matrix(now)  # of a turn by w, `now` becomes `now` + w x `now`
    weighted = across.mT * (kernel / level**2)[:, None, None]
    held = torch.nn.functional.pad(weighted @ across, (0, 6, 0, 6))
    return A + held, b + torch.nn.functional.pad((weighted @ off[..., None])[..., 0], (0, 6))
