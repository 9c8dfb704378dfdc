# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The poses of a track's scans made to fit each other: point to plane, all scans at once.

Beyond the paper. The network poses each scan on its own, to a degree and a decimetre. The scans of
one rigid object must lie on one surface: every scan is moved onto the others (and, where the object
is symmetric, onto their reflection in the canonical plane y = 0), round after round, with a robust
kernel that narrows. Of a long track a few scans do so, and each other one is moved onto what those
show. No label is used.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from wildshape.geometry.surface import mirrored, planes
from wildshape.geometry.transforms.rotation import rotation_from_vector
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import JointIcpConfig, TrackConfig
from wildshape.ops.nearest import nearest, nearest_k
from wildshape.ops.point_to_plane import point_to_plane
from wildshape.records import Points

_TRACK = TrackConfig()
_BATCH = 32


class Surface(NamedTuple):
    """Points and unit normals in the object frame."""

    points: Float[Tensor, "*n 3"]
    normals: Float[Tensor, "*n 3"]


class TrackFit(NamedTuple):
    """Poses of one object in a track's scans.

    Attributes:
        T_sensor_object: of every scan.
        refined: whether they were made to fit each other.
    """

    T_sensor_object: SE3
    refined: bool


def key_scans(count: int, config: TrackConfig = _TRACK) -> Int64[Tensor, "U"]:
    """Which of so many scans are fitted to each other: all, or of a long track some."""
    places = torch.linspace(0, count - 1, min(count, config.key_scans), dtype=torch.float32)
    return places.round().long()


def refine_checked(
    scans: list[Points],
    voted: SE3,
    odds: Float[Tensor, "V"] | None = None,
    *,
    mirror: bool,
    config: TrackConfig = _TRACK,
) -> TrackFit:
    """Refined poses, kept only if the scans then lie nearer to each other, and near the vote.

    Scans are moved onto all others and, from the vote again, onto the surest alone: those that are
    half hidden may agree on a wrong place. The better is kept. Of a long track the key scans are
    fitted to each other, and each other scan to them.

    Args:
        scans: of one object.
        voted: `T_sensor_object` to start from.
        odds: of each key scan being right, if known; those of other scans are not asked.
        mirror: the object is symmetric in the plane y = 0 of its frame.
        config: how they are refined.
    """
    odds = torch.ones(len(scans), dtype=torch.float32) if odds is None else odds
    if len(scans) > config.key_scans:
        return _by_key_scans(scans, voted, odds, mirror, config)
    sure = surest(odds, config.believed)
    found = [voted]
    for onto in (None,) if len(sure) == len(scans) else (None, sure):
        refined = refine_jointly(scans, voted, onto, mirror=mirror, config=config.coarse)
        found.append(refine_jointly(scans, refined, onto, mirror=False, config=config.fine))
    near = [poses for poses in found if bool(stayed_near(voted, poses, config).all())]
    best = min(near, key=lambda poses: _disagreement(scans, poses, mirror, config))
    return TrackFit(best, refined=best is not voted)


def _by_key_scans(
    scans: list[Points],
    voted: SE3,
    odds: Float[Tensor, "V"],
    mirror: bool,
    config: TrackConfig,
) -> TrackFit:
    """A pose that would leave the vote far behind stays what it was."""
    rows = key_scans(len(scans), config)
    keys = [scans[i] for i in rows.tolist()]
    fit = refine_checked(keys, voted[rows], odds[rows], mirror=mirror, config=config)
    if not fit.refined:
        return TrackFit(voted, refined=False)
    surface = fused_surface(keys, fit.T_sensor_object, config.onto, mirror=mirror)
    parts = [slice(start, start + _BATCH) for start in range(0, len(scans), _BATCH)]
    moved = [refine_onto(surface, scans[part], voted[part], config.onto) for part in parts]
    rotation, translation = (
        torch.cat([T.rotation for T in moved]),
        torch.cat([T.translation for T in moved]),
    )
    found = SE3(rotation, translation)
    found = found.where(stayed_near(voted, found, config), voted)
    found.rotation[rows], found.translation[rows] = (
        fit.T_sensor_object.rotation,
        fit.T_sensor_object.translation,
    )
    return TrackFit(found, refined=True)


@torch.no_grad()
def refine_jointly(
    scans: list[Points],
    T_sensor_object: SE3,
    onto: Int64[Tensor, "U"] | None = None,
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
        onto: the scans that all are moved onto; None: all.
        mirror: the object is symmetric in the plane y = 0 of its frame.
        config: how; `TrackConfig.fine` goes on where `coarse` has come to its end.
    """
    if len(scans) < 2:
        return T_sensor_object
    each = max(1, min(config.points, config.most // len(scans)))
    points, once = torch.from_numpy(sampled(scans, each)), taken_once(scans, each)
    start = T_sensor_object.to(torch.float32).inverse()
    T_object_sensor = start
    onto = torch.arange(len(scans)) if onto is None else onto
    normals = torch.zeros_like(points[onto])
    for step in range(config.rounds):
        moved = T_object_sensor.apply(points)
        if step % config.normal_rounds == 0:
            seen = moved[onto].flatten(0, 1)
            normals = surface_normals(seen, config, once[onto].flatten()).view_as(normals)
        found = _counterparts(moved, Surface(moved[onto], normals), onto, mirror)
        T_object_sensor = _moved(T_object_sensor, moved, *found, _width(step, config), config)
    back = _as_a_whole(start[onto], T_object_sensor[onto], points[onto], mirror)
    return (back @ T_object_sensor).inverse().to(T_sensor_object.rotation.dtype)


def surest(odds: Float[Tensor, "V"], share: float = _TRACK.believed) -> Int64[Tensor, "U"]:
    """The surer half of the scans, two at least, and all whose odds are this share of the best."""
    middle = odds.sort(descending=True).values[max(2, -(-len(odds) // 2)) - 1]
    return torch.nonzero(odds >= torch.minimum(middle, share * odds.max()))[:, 0]


def fused_surface(
    scans: list[Points], T_sensor_object: SE3, config: JointIcpConfig, *, mirror: bool
) -> Surface:
    """What some scans show together, `most` points (with `mirror` twice as many), object frame."""
    each = config.most // len(scans)
    points = torch.from_numpy(sampled(scans, each))
    points = T_sensor_object.to(torch.float32).inverse().apply(points).flatten(0, 1)
    normals = surface_normals(points, config, taken_once(scans, each).flatten())
    surface = Surface(points, normals)
    return Surface(*(mirrored(part[None])[0] for part in surface)) if mirror else surface


@torch.no_grad()
def refine_onto(
    surface: Surface, scans: list[Points], T_sensor_object: SE3, config: JointIcpConfig
) -> SE3:
    """Poses near the given ones under which each scan by itself lies on a surface."""
    points = torch.from_numpy(sampled(scans, config.points))
    T_object_sensor = T_sensor_object.to(torch.float32).inverse()
    for step in range(config.rounds):
        moved = T_object_sensor.apply(points)
        nearest = nearest_k(moved.flatten(0, 1)[None], surface.points[None], 1).index
        nearest = nearest.view(moved.shape[:2])
        width = _width(step, config)
        T_object_sensor = _moved(T_object_sensor, moved, surface, nearest, width, config)
    return T_object_sensor.inverse().to(T_sensor_object.rotation.dtype)


def stayed_near(before: SE3, after: SE3, config: TrackConfig = _TRACK) -> Bool[Tensor, "V"]:
    """Which poses moved no farther than a network errs, half turns aside."""
    moved = before.inverse() @ after
    return (moved.angle() < config.within_rad) & (moved.translation.norm(dim=-1) < config.within_m)


def sampled(scans: list[Points], count: int) -> Float[np.ndarray, "V n 3"]:
    """As many points of every scan, chosen by a fixed seed."""
    rng = np.random.default_rng(0)
    rows = [rng.permutation(len(scan))[np.arange(count) % len(scan)] for scan in scans]
    return np.stack([scan[row] for scan, row in zip(scans, rows)])


def taken_once(scans: list[Points], count: int) -> Bool[Tensor, "V n"]:
    """Which of the points that `sampled` gives are no repetition: small scans are taken again."""
    sizes = torch.tensor([len(scan) for scan in scans])
    return torch.arange(count) < sizes[:, None]


def surface_normals(
    points: Float[Tensor, "n 3"],
    config: JointIcpConfig = _TRACK.coarse,
    distinct: Bool[Tensor, "n"] | None = None,
) -> Float[Tensor, "n 3"]:
    """Unit normals: the direction in which the neighbourhood is thinnest.

    Neighbours are those that are no repetition (`distinct`): one point many times has no plane.
    """
    some = points if distinct is None else points[distinct]
    around = nearest_k(points[None], some[None], min(config.normal_points, len(some))).index
    return planes(some[None], around)[1][0]


def _width(step: int, config: JointIcpConfig) -> float:
    """Of the robust kernel."""
    return max(config.widest_m * config.narrower**step, config.narrowest_m)


def _moved(
    T_object_sensor: SE3,
    points: Float[Tensor, "V n 3"],
    onto: Surface,
    counterpart: Int64[Tensor, "V n"],
    width: float,
    config: JointIcpConfig,
) -> SE3:
    """One Gauss-Newton step of every scan, its points posed, onto the points' counterparts."""
    centre = points.mean(1)
    A, b, weight = point_to_plane(points, centre, *onto, counterpart, width, config.holding)
    damping = config.ridge * weight[:, None, None] + 1e-6
    motion = -config.step * torch.linalg.solve(A + damping * torch.eye(6, dtype=A.dtype), b)
    turn = rotation_from_vector(motion[:, :3])
    about = SE3(turn, centre + motion[:, 3:] - (turn @ centre[..., None])[..., 0])
    return about @ T_object_sensor


def _counterparts(
    points: Float[Tensor, "V n 3"], surface: Surface, scans: Int64[Tensor, "U"], mirror: bool
) -> tuple[Surface, Int64[Tensor, "V n"]]:
    """The surface, reflected if objects are, and where on it another scan is nearest to each point.

    `surface`: of some scans, `(U, n, 3)`; `scans`: which they are.
    """
    count, size, _ = points.shape
    own = torch.arange(count).repeat_interleave(size)
    groups = scans.repeat_interleave(size)
    target, normals = (part.flatten(0, 1) for part in surface)
    if mirror:
        target, normals = (mirrored(part[None])[0] for part in (target, normals))
        groups = torch.cat((groups, groups))
    query = points.flatten(0, 1)[None]
    found = nearest_k(query, target[None], 1, groups=(own[None], groups[None]))
    return Surface(target, normals), found.index.view(count, size)


def _as_a_whole(start: SE3, end: SE3, points: Tensor, mirror: bool) -> SE3:
    """The motion that takes the track back to where it was on average.

    A mirror plane has found its place: then only what lies in the plane is taken back.
    """
    mean = (start.rotation @ end.rotation.mT).mean(0)
    keep = mean.new_tensor((1.0, 0.0, 1.0)) if mirror else mean.new_ones(3)
    if mirror:
        angle = torch.atan2(mean[0, 2] - mean[2, 0], mean[0, 0] + mean[2, 2])
        c, s = torch.cos(angle), torch.sin(angle)
        zero, one = torch.zeros_like(c), torch.ones_like(c)
        turn = torch.stack((c, zero, s, zero, one, zero, -s, zero, c)).view(3, 3)
    else:
        u, _, v = torch.linalg.svd(mean)
        turn = u @ torch.diag(mean.new_tensor((1.0, 1.0, float(torch.linalg.det(u @ v))))) @ v
    was = start.apply(points).flatten(0, 1).mean(0) * keep
    now = end.apply(points).flatten(0, 1).mean(0) * keep
    return SE3(turn, was - turn @ now)


def _disagreement(
    scans: list[Points], T_sensor_object: SE3, mirror: bool, config: TrackConfig
) -> float:
    """Mean distance of every other scan to those between them, metres, each at most `far_m`."""
    halves = [
        fused(scans, T_sensor_object, part, config.most_points)
        for part in (slice(0, None, 2), slice(1, None, 2))
    ]
    bank = mirrored(halves[1][None])[0] if mirror else halves[1]
    found = nearest(halves[0][None], bank[None])
    return float(found.distance_squared.sqrt().clamp_max(config.vote.far_m).mean())


def fused(
    scans: list[Points], T_sensor_object: SE3, part: slice, count: int
) -> Float[Tensor, "n 3"]:
    """Points of some of the scans in the object frame, about `count` at most."""
    rng = np.random.default_rng(0)
    chosen = range(len(scans))[part]
    most = max(1, count // len(chosen))
    clouds = []
    for i in chosen:
        points = torch.from_numpy(scans[i][rng.permutation(len(scans[i]))[:most]]).double()
        clouds.append(T_sensor_object[i].inverse().apply(points))
    return torch.cat(clouds).float()
