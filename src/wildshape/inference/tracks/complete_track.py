# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One object from all scans of its track: headings voted, poses refined, one shape (METHOD 11).

Beyond the paper. Each scan was completed on its own first; here they are held against each other.
Nothing but the scans and what the network said of each is used.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.box import FittedBox, unit_of
from wildshape.geometry.sampling import voxel_thin
from wildshape.geometry.surface import mirrored
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.boxes import carried, fit_to_scans
from wildshape.inference.choose_hypothesis import NetworkInput
from wildshape.inference.confidence import judged, odds_of
from wildshape.inference.config import BoxConfig, InferenceConfig, TrackConfig
from wildshape.inference.free_space import Rays, Sights, without_free_space
from wildshape.inference.refine import denser, drawn_to, padded, partners
from wildshape.inference.tracks.heading_vote import (
    half_turn,
    likeness_of_next,
    nearness_of_next,
    turned_where,
    voted_signs,
)
from wildshape.inference.tracks.joint_icp import (
    fused_surface,
    refine_jointly,
    refine_onto,
    stayed_near,
    surest,
)
from wildshape.inference.tracks.pose_outliers import without_outliers
from wildshape.inference.tracks.track_cost import network_inputs, track_cost
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.trust import TrackFeatures
from wildshape.method.trust_features import track_features
from wildshape.ops.nearest import nearest
from wildshape.records import Completion, Points

_BATCH, _LEAST_SURE = 32, 1e-3
_DEFAULT = InferenceConfig()


class TrackFit(NamedTuple):
    """Poses of one object in a track's scans.

    Attributes:
        T_sensor_object: of every scan.
        refined: whether they were made to fit each other.
    """

    T_sensor_object: SE3
    refined: bool


class Gathered:
    """Completions of a track's single scans without their points, and their mean shape.

    Points of one index are the same place of every canonical shape. That holds for the network's
    own points, which come first.

    Attributes:
        done: each scan on its own, in time order, without points.
        scans: of one rigid object, sensor frames.
        weights: what each counts, the odds that it is right.
    """

    def __init__(self, settings: ModelSettings) -> None:
        """`settings`: of the network that completes them."""
        self.settings = settings
        self.done: list[Completion] = []
        self.scans: list[Points] = []
        self._odds: list[float] = []
        self._sum = torch.zeros(settings.network.points, 3, dtype=torch.float64)

    def add(self, done: Completion, scan: Points) -> None:
        """The next scan."""
        own = torch.from_numpy(done.points[: len(self._sum)]).double()
        self._odds.append(odds_of(done))
        self._sum += self._odds[-1] * done.pose.inverse().apply(own)
        self.done.append(replace(done, points=done.points[:0].copy()))
        self.scans.append(scan)

    @property
    def weights(self) -> Float[Tensor, "V"]:
        """What each scan counts: the odds that it is right."""
        return torch.tensor(self._odds, dtype=torch.float64)

    @property
    def sure(self) -> Float[Tensor, "V"]:
        """How sure each is of its heading, 0 to 1: `p_pose`, or the confidence without it."""
        stated = [one.confidence if one.p_pose is None else one.p_pose for one in self.done]
        return torch.tensor(stated, dtype=torch.float64).clamp_min(_LEAST_SURE)

    @property
    def shape(self) -> Float[Tensor, "P 3"]:
        """The mean of the canonical shapes."""
        return self._sum / self.weights.sum()


@torch.inference_mode()
def complete_together(
    gathered: Gathered, config: InferenceConfig = _DEFAULT, rays: Rays = ()
) -> Iterator[Completion]:
    """Completions of a track's single scans made those of one object.

    Args:
        gathered: of two scans or more.
        config: how they are made so.
        rays: that passed the object by, one set a scan, if any are known.

    Returns:
        One a scan; each has its points when it is taken.
    """
    done, scans, settings = gathered.done, gathered.scans, gathered.settings
    shape = gathered.shape
    poses = stack([item.pose for item in done])
    inputs = network_inputs(scans, settings)
    voted = _voted(poses, shape, gathered, inputs, config.track)
    mirror, unit = settings.network.mirror, unit_of(settings.extent_m[1])
    clouds, start = _in_units(scans, voted, unit)
    fit = refine_checked(clouds, start, gathered.weights, mirror=mirror, config=config.track)
    seen = _seen(clouds, fit.T_sensor_object, mirror, config.track)
    shape = unit * drawn_to(shape[None] / unit, padded([seen]), config.track)[0]
    fit = fit._replace(T_sensor_object=_scaled(fit.T_sensor_object, unit))
    body = settings.sensor == "lidar"
    solid = shape
    if any(one is not None for one in rays):
        sights = Sights(scans, rays, config.free_space)
        solid = without_free_space(shape, fit.T_sensor_object, sights)
    fitted = _box(solid, scans, fit.T_sensor_object, config.box, mirror=mirror, body=body)
    whole = _denser(shape, config) if settings.facing else shape
    cost = track_cost(shape, fit.T_sensor_object, inputs, settings)
    mean = float(np.mean([item.confidence for item in done]))
    trust, evidence = settings.trust, _evidence(done, fit.T_sensor_object, fitted, cost)

    def together(i: int) -> Completion:
        item, T_sensor_object = done[i], fit.T_sensor_object[i]
        item = replace(
            item,
            points=T_sensor_object.apply(whole).float().numpy(),
            pose=T_sensor_object,
            box=carried(fitted, T_sensor_object),
            confidence=0.0 if item.warning else mean,
            cost=float(cost[i]),
            refined=fit.refined,
        )
        return judged(item, trust and trust.track, evidence[i], settings, config.reasons)

    return map(together, range(len(done)))


def _evidence(
    done: list[Completion], T_sensor_object: SE3, fitted: FittedBox, cost: Float[Tensor, "V"]
) -> list[TrackFeatures] | list[None]:
    """What is known of each scan of the track; nothing where it is not known of all scans."""
    if not all(item.evidence for item in done):
        return [None] * len(done)
    length, width, height = fitted.size.tolist()
    return track_features(done, T_sensor_object, (length, width, height), cost)


def _denser(shape: Float[Tensor, "P 3"], config: InferenceConfig) -> Float[Tensor, "Q 3"]:
    return denser(shape[None], partners(shape[None], config.refine.partner))[0]


def _in_units(scans: list[Points], T_sensor_object: SE3, unit: float) -> tuple[list[Points], SE3]:
    """Both as if the object were as large as a vehicle (`unit_of`)."""
    if unit == 1.0:
        return scans, T_sensor_object
    return [scan / np.float32(unit) for scan in scans], _scaled(T_sensor_object, 1 / unit)


def _scaled(T_a_b: SE3, factor: float) -> SE3:
    return SE3(T_a_b.rotation, T_a_b.translation * factor)


def _box(
    shape: Float[Tensor, "P 3"],
    scans: list[Points],
    T_sensor_object: SE3,
    config: BoxConfig,
    *,
    mirror: bool,
    body: bool,
) -> FittedBox:
    """One box for all scans of the track, object frame."""
    T_object_sensor = T_sensor_object.inverse()
    seen = (T_object_sensor[i].apply(torch.from_numpy(s).double()) for i, s in enumerate(scans))
    return fit_to_scans(shape, seen, mirror=mirror, body=body, config=config)


def _voted(
    T_sensor_can: SE3,
    shape: Float[Tensor, "P 3"],
    gathered: Gathered,
    inputs: list[NetworkInput],
    config: TrackConfig,
) -> SE3:
    """The same poses, all looking one way and no outlier among them."""
    settings = gathered.settings
    middle = float(shape[:, 0].amin() + shape[:, 0].amax()) / 2
    turned = T_sensor_can @ half_turn(middle)
    stands = track_cost(shape, T_sensor_can, inputs, settings)
    gain = track_cost(shape, turned, inputs, settings) - stands
    unit = unit_of(settings.extent_m[1])
    if settings.sensor == "lidar":
        links = nearness_of_next(T_sensor_can.inverse().translation, middle, config.vote)
    else:
        clouds = _some_of_each(gathered.scans, T_sensor_can, config.voting_points) / unit
        mirror = settings.network.mirror
        links = likeness_of_next(clouds, middle / unit, mirror=mirror, config=config.vote)
    signs = voted_signs(T_sensor_can.rotation, gain / unit, links, gathered.sure, config.vote)
    return without_outliers(turned_where(T_sensor_can, signs, middle), config)


def _some_of_each(scans: list[Points], T_sensor_object: SE3, count: int) -> Float[Tensor, "V n 3"]:
    """As many points of each scan, object frame."""
    rng = np.random.default_rng(0)
    rows = [rng.permutation(len(s))[np.arange(count) % len(s)] for s in scans]
    picked = torch.stack([torch.from_numpy(s[row]) for s, row in zip(scans, rows)])
    return T_sensor_object.inverse().apply(picked.double()).float()


def refine_checked(
    scans: list[Points],
    voted: SE3,
    odds: Float[Tensor, "V"] | None = None,
    *,
    mirror: bool,
    config: TrackConfig = _DEFAULT.track,
) -> TrackFit:
    """Refined poses, kept only if the scans then lie nearer to each other, and near the vote.

    Scans are moved onto all others and, from the vote again, onto the surest alone: those that are
    half hidden may agree on a wrong place. The better is kept. Of a long track the key scans are
    fitted to each other, and each other scan to them.

    Args:
        scans: of one object.
        voted: `T_sensor_object` to start from.
        odds: of each scan being right, if known.
        mirror: the object is symmetric in the plane y = 0 of its frame.
        config: how they are refined.
    """
    odds = torch.ones(len(scans)) if odds is None else odds
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
    rows = torch.linspace(0, len(scans) - 1, config.key_scans).round().long()
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
    near = stayed_near(voted, SE3(rotation, translation), config)
    rotation = torch.where(near[:, None, None], rotation, voted.rotation)
    translation = torch.where(near[:, None], translation, voted.translation)
    rotation[rows], translation[rows] = (
        fit.T_sensor_object.rotation,
        fit.T_sensor_object.translation,
    )
    return TrackFit(SE3(rotation, translation), refined=True)


def _disagreement(
    scans: list[Points], T_sensor_object: SE3, mirror: bool, config: TrackConfig
) -> float:
    """Mean distance of every other scan to those between them, metres, each at most `far_m`."""
    halves = [
        _fused(scans, T_sensor_object, part, config.most_points)
        for part in (slice(0, None, 2), slice(1, None, 2))
    ]
    bank = mirrored(halves[1][None])[0] if mirror else halves[1]
    found = nearest(halves[0][None], bank[None])
    return float(found.distance_squared.sqrt().clamp_max(config.vote.far_m).mean())


def _fused(
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


def _seen(
    scans: list[Points], T_sensor_object: SE3, mirror: bool, config: TrackConfig
) -> Float[Tensor, "n 3"]:
    """The surface that the scans saw, reflected and thinned to an even density, object frame."""
    fused = _fused(scans, T_sensor_object, slice(None), config.most_points)
    fused = mirrored(fused[None])[0] if mirror else fused
    return torch.from_numpy(voxel_thin(fused.numpy(), config.voxel_m))
