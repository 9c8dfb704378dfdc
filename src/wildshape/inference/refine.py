# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Completions held against their scans once more: poses and sizes fitted, seen sides drawn to them.

Beyond the paper (METHOD 11, test-time refinement). The network knows an object's pose to a few
degrees and its size to a few percent, and draws shapes towards what is usual; the scan in hand
knows better where it saw something. All scans of a batch are refined together, by the same lines
on a CPU and on a GPU.

The fit is of nine numbers a scan (rotation, translation and a stretch along the canonical axes) by
Gauss-Newton, each scan point to the plane of the shape around it. The network's answer is the
prior, and that a LiDAR is held level, to a degree, where it nearly is. One side of a car tells its
heading to a fraction of a degree, but its pitch and roll to one or two.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.geometry.box import unit_of
from wildshape.geometry.densify import with_exact, with_seen
from wildshape.geometry.sampling import voxel_thin
from wildshape.geometry.surface import gathered, is_mirrored, mirrored, planes, reflected
from wildshape.geometry.transforms.rotation import cross_matrix, rotation_from_vector
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import RefineConfig, TrackConfig
from wildshape.method.checkpoint import ModelSettings
from wildshape.ops.nearest import nearest, nearest_k
from wildshape.records import Points

_FAR = 2.5
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


class Refined(NamedTuple):
    """Shapes and their poses.

    Attributes:
        shapes: canonical frame, metres.
        rotation: of `T_scan_canonical`.
        translation: of the same, metres.
    """

    shapes: Float[Tensor, "B P 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]


def refine(
    scans: Sequence[Points],
    shapes: Float[Tensor, "B P 3"],
    rotation: Float[Tensor, "B 3 3"],
    translation: Float[Tensor, "B 3"],
    *,
    mirror: bool,
    up: Float[Tensor, "3"] | None = None,
    config: RefineConfig = _DEFAULT,
) -> Refined:
    """Poses and shapes after a look at the scans they came from.

    Args:
        scans: at least a handful of points each, metres.
        shapes: canonical frame, one a scan.
        rotation: of `T_scan_canonical`, good to some ten degrees.
        translation: of the same, good to some decimetres.
        mirror: what was seen of one side of y = 0 is known of the other.
        up: canonical direction that the scans' z axes point in, if they were taken level; what is
            far from it (`tilted_deg`) is taken for tilted and left so.
        config: how they are fitted.
    """
    unit = _units(shapes)
    exact = shapes.double() / unit
    own = exact[:, : exact.shape[1] // 2] if mirror and is_mirrored(exact) else exact
    clouds = _some_of_each(scans, config.scan_points, exact.device)
    clouds = clouds._replace(points=clouds.points.double() / unit)
    start = rotation.double(), translation.double() / unit[:, 0]
    fit = fit_to_scans(clouds, exact, *start, up, config)
    seen = _thinned(clouds._replace(points=fit.seen(clouds.points)), config.voxel_m, mirror)
    drawn = drawn_to(own * fit.stretch[:, None], seen, config)
    whole = drawn if own is exact else mirrored(drawn)
    moved = fit.translation * unit[:, 0]
    return Refined((whole * unit).to(shapes.dtype), fit.rotation, moved)


def _units(shapes: Float[Tensor, "B P 3"]) -> Float[Tensor, "B 1 1"]:
    """`unit_of` each shape."""
    extents = (shapes.amax(1) - shapes.amin(1)).double().norm(dim=-1)
    units = [unit_of(extent) for extent in extents.tolist()]
    return torch.tensor(units, dtype=torch.float64, device=shapes.device)[:, None, None]


def _some_of_each(scans: Sequence[Points], count: int, device: torch.device) -> Clouds:
    """At most so many points of each scan, chosen by a fixed seed."""
    rows = [np.random.default_rng(0).permutation(len(scan))[:count] for scan in scans]
    return padded([torch.from_numpy(scan[row]) for scan, row in zip(scans, rows)], device)


def padded(clouds: Sequence[Tensor], device: torch.device | str = "cpu") -> Clouds:
    """Clouds of different sizes as one."""
    points = torch.nn.utils.rnn.pad_sequence(list(clouds), batch_first=True)
    return Clouds(points.to(device), torch.tensor([len(one) for one in clouds], device=device))


def _thinned(seen: Clouds, voxel_m: float, mirror: bool) -> Clouds:
    """Scans of even density, with their reflections in y = 0 if the objects are symmetric."""
    thin = []
    for points, size in zip(seen.points.float().cpu(), seen.sizes.tolist()):
        real = points[:size]
        both = torch.cat((real, reflected(real))) if mirror else real
        thin.append(torch.from_numpy(voxel_thin(both.numpy(), voxel_m)))
    return padded(thin, seen.points.device)


def drawn_to(
    shapes: Float[Tensor, "B P 3"], seen: Clouds, config: RefineConfig | TrackConfig = _DEFAULT
) -> Float[Tensor, "B P 3"]:
    """The shapes' points drawn to the mean of what was seen around them; the others stay.

    Args:
        shapes: canonical frame.
        seen: points of even density, the same frame.
        config: how far, and how stiffly.
    """
    most = _FAR * config.reach_m
    found = nearest_k(
        shapes.float(), seen.points.float(), config.drawn_by, None, seen.sizes, most=most
    )
    weight = (-found.distance_squared.to(shapes.dtype) / config.reach_m**2).exp()  # of none: 0
    near = gathered(seen.points.to(shapes.dtype), found.index)
    total = weight.sum(-1, keepdim=True) + config.stiffness
    return ((weight[..., None] * near).sum(2) + config.stiffness * shapes) / total


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
    whole, apart = shapes.float(), []  # squared, at each match
    for step in range(config.iterations):
        if step in config.matched_at:
            local = found.unstretched(scans.points).float()
            near = nearest_k(local, whole, config.plane_points, scans.sizes)
            matched = planes(shapes, near.index)
            apart.append(near.distance_squared[..., 0])
        A, b = _equations(found.seen(scans.points), *matched, found.stretch, scans.counted, config)
        A, b = _with_prior(A, b, motion, config)
        if up is not None:
            A, b = _with_level(A, b, found.rotation[:, 2], up, config)
        change = -torch.linalg.solve(A, b)
        motion = motion + change
        R = found.rotation @ rotation_from_vector(change[:, :3]).mT
        t = found.translation - (R @ change[:, 3:6, None])[..., 0]
        found = Fit(R, t, motion[:, 6:].exp())
    local = found.unstretched(scans.points).float()
    apart.append(nearest(local, whole, scans.sizes).distance_squared)
    before, after = (_off(squared, scans, config) for squared in (apart[0], apart[-1]))
    worse = after > _allowed(before, start, up, config)
    return Fit(
        *(torch.where(worse.view(-1, *[1] * (a.ndim - 1)), b, a) for a, b in zip(found, start))
    )


def _off(squared: Float[Tensor, "B n"], scans: Clouds, config: RefineConfig) -> Float[Tensor, "B"]:
    """Mean of distances of scan points to the shape, each at most `kernel_m`; of padding 0."""
    apart = squared.sqrt().clamp_max(config.kernel_m)
    return apart.double().sum(1) / scans.sizes


def _allowed(
    before: Float[Tensor, "B"], start: Fit, up: Tensor | None, config: RefineConfig
) -> Float[Tensor, "B"]:
    """How far from the shape a scan may lie: no farther than before, or than a level one may."""
    if up is None:
        return before
    off = (start.rotation[:, 2] - up).norm(dim=-1)
    askew = (off > math.radians(config.level_deg)) & (off < math.radians(config.tilted_deg))
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
    share = config.effective_points / counted.float().sum(1, keepdim=True) / config.error_m**2
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


def with_its_scan(
    whole: Points,
    shape: Float[Tensor, "P 3"],
    scan: Points,
    T_sensor_canonical: SE3,
    settings: ModelSettings,
    config: RefineConfig = _DEFAULT,
) -> Points:
    """A shape with what its scan shows, sensor frame; as it was if it has no middles.

    Args:
        whole: sensor frame; the shape's own points, then middles (`denser`).
        shape: its own, canonical frame.
        scan: sensor frame.
        T_sensor_canonical: the pose.
        settings: of the weights.
        config: how near, and how dense.
    """
    if len(whole) == len(shape):
        return whole
    T_canonical_sensor = T_sensor_canonical.inverse()
    middles, seen = (T_canonical_sensor.apply_numpy(part) for part in (whole[len(shape) :], scan))
    added = shown(middles, shape.numpy(), seen, settings, config)
    return np.concatenate((whole[: len(shape)], T_sensor_canonical.apply_numpy(added)))


def shown(
    middles: Points,
    shape: Points,
    seen: Points,
    settings: ModelSettings,
    config: RefineConfig = _DEFAULT,
) -> Points:
    """What is added to a shape's own points: middles, and what scans saw (`with_seen`)."""
    mirror = settings.network.mirror
    if settings.sensor == "camera":
        return with_exact(middles, shape, seen, mirror=mirror)
    voxel, near = (length * settings.unit for length in (config.seen_voxel_m, config.seen_near_m))
    return with_seen(middles, shape, seen, mirror=mirror, voxel=voxel, near=near)
