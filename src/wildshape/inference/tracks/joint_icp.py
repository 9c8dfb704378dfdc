# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The poses of a track's scans made to fit each other: point to plane, all scans at once.

Beyond the paper. The network poses each scan on its own, to a degree and a decimetre. The scans of
one rigid object must lie on one surface: every scan is moved onto the others (and, where the object
is symmetric, onto their reflection in the canonical plane y = 0), round after round, with a robust
kernel that narrows. No label is used.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import JointIcpConfig, TrackConfig
from wildshape.ops.nearest import nearest
from wildshape.records import Points

_BLOCK, _AWAY_M = 2048, 1e4
_TRACK = TrackConfig()


class _Surface(NamedTuple):
    """Points and unit normals of the scans in the object frame, `(V, n, 3)` each."""

    points: Tensor
    normals: Tensor


@torch.no_grad()
def refine_jointly(
    scans: list[Points],
    T_sensor_object: SE3,
    *,
    mirror: bool,
    config: JointIcpConfig = _TRACK.coarse,
) -> SE3:
    """Poses near the given ones under which the scans lie on one surface.

    What the scans cannot tell, where the object as a whole lies in its frame, stays as it was on
    average.

    Args:
        scans: of one rigid object, sensor frames, metres.
        T_sensor_object: one pose a scan, good to about a metre and 30 degrees.
        mirror: the object is symmetric in the plane y = 0 of its frame.
        config: how; `TrackConfig.fine` goes on where `coarse` has come to its end.
    """
    if len(scans) < 2:
        return T_sensor_object
    points = torch.from_numpy(_sampled(scans, min(config.points, config.most // len(scans))))
    start = T_sensor_object.to(torch.float32).inverse()
    T_object_sensor = start
    normals = torch.zeros_like(points)
    rounds = config.rounds
    for step in range(rounds):
        moved = T_object_sensor.apply(points)
        if step % 3 == 0 or step >= rounds - 2:
            normals = surface_normals(moved.flatten(0, 1), config.normal_m).view_as(moved)
        width = max(config.widest_m * config.narrower**step, config.narrowest_m)
        T_object_sensor = _moved(T_object_sensor, _Surface(moved, normals), width, mirror, config)
    T_object_sensor = _as_a_whole(start, T_object_sensor, points, mirror) @ T_object_sensor
    return T_object_sensor.inverse().to(T_sensor_object.rotation.dtype)


def stayed_near(before: SE3, after: SE3, config: TrackConfig = _TRACK) -> bool:
    """Whether no pose moved farther than a network errs, half turns aside."""
    moved = before.inverse() @ after
    turned = bool((moved.angle() < config.within_rad).all())
    return turned and bool((moved.translation.norm(dim=-1) < config.within_m).all())


def _sampled(scans: list[Points], count: int) -> Float[np.ndarray, "V n 3"]:
    """As many points of every scan, chosen by a fixed seed."""
    rng = np.random.default_rng(0)
    rows = [rng.permutation(len(scan))[np.arange(count) % len(scan)] for scan in scans]
    return np.stack([scan[row] for scan, row in zip(scans, rows)])


def surface_normals(
    points: Float[Tensor, "n 3"], radius: float = _TRACK.coarse.normal_m
) -> Float[Tensor, "n 3"]:
    """Unit normals: the direction in which the neighbourhood, `radius` metres, is thinnest."""
    products = (points[:, :, None] * points[:, None]).flatten(1)
    moments = torch.cat((torch.ones_like(points[:, :1]), points, products), dim=1)
    blocks = points.split(_BLOCK)
    sums = torch.cat([_weight(block, points, radius) @ moments for block in blocks])
    mean, second = sums[:, 1:4] / sums[:, :1], (sums[:, 4:] / sums[:, :1]).view(-1, 3, 3)
    covariance = second - mean[:, :, None] * mean[:, None]
    return torch.linalg.eigh(covariance).eigenvectors[:, :, 0]


def _weight(
    block: Float[Tensor, "b 3"], points: Float[Tensor, "n 3"], radius: float
) -> Float[Tensor, "b n"]:
    """How much each point counts in the neighbourhood of each of a block's."""
    squared = (points.square().sum(-1), block.square().sum(-1)[:, None])
    distance = torch.addmm(squared[1] + squared[0], block, points.T, alpha=-2)
    return distance.div_(-(radius**2)).add_(1).relu_().square_()


def _moved(
    T_object_sensor: SE3, surface: _Surface, width: float, mirror: bool, config: JointIcpConfig
) -> SE3:
    """One Gauss-Newton step of every scan onto the others."""
    points = surface.points
    at, normal = _counterparts(surface, mirror)
    off = points - at
    kernel = (1 + off.square().sum(-1) / width**2) ** -2  # Geman-McClure
    centre = points.mean(1, keepdim=True)
    axes = torch.eye(3).expand(*points.shape[:2], 3, 3)
    # Rows of the problem: along the normal, and weakly along each axis, against sliding.
    directions = torch.cat((normal[:, :, None], axes), dim=2)
    share = torch.tensor((1.0, *(config.holding,) * 3))
    lever = torch.linalg.cross((points - centre)[:, :, None].expand_as(directions), directions)
    rows = torch.cat((lever, directions), dim=-1)
    weight = kernel[:, :, None] * share
    residual = (off[:, :, None] * directions).sum(-1)
    A = torch.einsum("vpd,vpdi,vpdj->vij", weight, rows, rows)
    b = torch.einsum("vpd,vpdi,vpd->vi", weight, rows, residual)
    damping = config.ridge * kernel.sum(1)[:, None, None] + 1e-6
    motion = -config.step * torch.linalg.solve(A + damping * torch.eye(6), b)
    turn = torch.linalg.matrix_exp(_cross_matrix(motion[:, :3]))
    about = SE3(turn, centre[:, 0] + motion[:, 3:] - (turn @ centre[:, 0, :, None])[..., 0])
    return about @ T_object_sensor


def _cross_matrix(w: Float[Tensor, "V 3"]) -> Float[Tensor, "V 3 3"]:
    x, y, z = w.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), -1).view(-1, 3, 3)


def _counterparts(surface: _Surface, mirror: bool) -> tuple[Tensor, Tensor]:
    """The nearest point of the other scans to each point, and its normal."""
    count, size, _ = surface.points.shape
    bank = [part.flatten(0, 1) for part in surface]
    if mirror:
        across = torch.tensor((1.0, -1.0, 1.0))
        bank = [torch.cat((part, part * across)) for part in bank]
    own = torch.arange(len(bank[0])) // size % count == torch.arange(count)[:, None]
    others = torch.where(own[:, :, None], _AWAY_M, bank[0])
    index = nearest(surface.points, others).index
    return bank[0][index], bank[1][index]


def _as_a_whole(start: SE3, end: SE3, points: Tensor, mirror: bool) -> SE3:
    """The motion that takes the track back to where it was on average.

    A mirror plane has found its place: then only what lies in the plane is taken back.
    """
    keep = torch.tensor((1.0, 0.0, 1.0)) if mirror else torch.ones(3)
    mean = (start.rotation @ end.rotation.mT).mean(0)
    if mirror:
        angle = torch.atan2(mean[0, 2] - mean[2, 0], mean[0, 0] + mean[2, 2])
        c, s = torch.cos(angle), torch.sin(angle)
        zero, one = torch.zeros_like(c), torch.ones_like(c)
        turn = torch.stack((c, zero, s, zero, one, zero, -s, zero, c)).view(3, 3)
    else:
        u, _, v = torch.linalg.svd(mean)
        turn = u @ torch.diag(torch.tensor((1.0, 1.0, float(torch.linalg.det(u @ v))))) @ v
    was = start.apply(points).flatten(0, 1).mean(0) * keep
    now = end.apply(points).flatten(0, 1).mean(0) * keep
    return SE3(turn, was - turn @ now)
