# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One object from all scans of its track: headings voted, poses refined, one shape (METHOD 11).

Beyond the paper. Each scan was completed on its own first, of a long track the key scans; here they
are held against each other. Nothing but the scans and what the network said of each is used.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.geometry.box import FittedBox, box_axes
from wildshape.geometry.densify import denser, partners
from wildshape.geometry.sampling import sorted_points, voxel_thin
from wildshape.geometry.surface import mirrored
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.boxes import carried, fit_for
from wildshape.inference.confidence import (
    Glance,
    glance_of,
    judged,
    odds_of,
    reasons_of_track,
)
from wildshape.inference.config import BoxConfig, InferenceConfig, ReasonRule, TrackConfig
from wildshape.inference.free_space import Rays, Sights, without_free_space
from wildshape.inference.refine import drawn_to, padded, shown
from wildshape.inference.single_scans import Looked, off_ground
from wildshape.inference.tracks.heading_vote import (
    FEWEST,
    followed_signs,
    half_turn,
    likeness_of_next,
    nearness_of_next,
    slow,
    turned_where,
    voted_signs,
)
from wildshape.inference.tracks.joint_icp import fused, refine_checked, sampled
from wildshape.inference.tracks.pose_outliers import (
    SensorMotion,
    without_leaps,
    without_outliers,
)
from wildshape.inference.tracks.track_cost import network_inputs, track_cost
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.choose_hypothesis import NetworkInput
from wildshape.method.trust import TrackFeatures
from wildshape.method.trust_features import track_features
from wildshape.ops.device import plain_torch
from wildshape.ops.nearest import nearest
from wildshape.records import Box, Completion, Points, Sensor

_LEAST_SURE = 1e-3
_ASTRAY = 2.0  # times as far from the shape as scans usually are
_DEFAULT = InferenceConfig()


class Gathered:
    """What a track's scans say, each on its own, and the mean shape of those completed.

    Points of one index are the same place of every canonical shape. That holds for the network's
    own points, which come first.

    Attributes:
        said: of each scan, in time order; completions are without points.
        scans: of one rigid object, sensor frames, sorted: points are drawn from them.
        rows: of the scans that were completed; the others were looked at alone.
        weights: what each counts, the odds that it is right; 0 of those looked at alone.
    """

    def __init__(self, settings: ModelSettings) -> None:
        """`settings`: of the network that completes them."""
        self.settings = settings
        self.said: list[Completion | Glance] = []
        self.scans: list[Points] = []
        self._odds: list[float] = []
        self._sum = torch.zeros(settings.network.points, 3, dtype=torch.float64)
        self._bottoms = torch.zeros(3, dtype=torch.float64)

    def add(self, done: Completion, scan: Points) -> None:
        """The next scan, completed; its ground goes, unless the network completes that, too."""
        if done.refined and self.settings.sensor == "lidar":
            shape = done.pose.inverse().apply_numpy(done.points)
            scan = off_ground(scan, shape, done.pose)
        own = torch.from_numpy(done.points[: len(self._sum)]).double()
        self._odds.append(odds_of(done))
        T_canonical_sensor = done.pose.inverse()
        self._sum += self._odds[-1] * T_canonical_sensor.apply(own)
        self._bottoms += self._odds[-1] * T_canonical_sensor.apply(_bottom(done.box))[0]
        self.said.append(replace(done, points=done.points[:0].copy()))
        self.scans.append(sorted_points(scan))

    def pass_by(self, looked: Looked, sensor: Sensor | None, rule: ReasonRule) -> None:
        """The next scan, looked at alone."""
        self._odds.append(0.0)
        said = looked.found.said(0)
        self.said.append(glance_of(looked.scans[0], sensor, *said, self.settings, rule))
        self.scans.append(sorted_points(looked.seen[0]))

    @property
    def done(self) -> list[Completion]:
        """The scans that were completed."""
        return [one for one in self.said if isinstance(one, Completion)]

    @property
    def rows(self) -> Int64[Tensor, "U"]:
        """Of the scans that were completed."""
        return torch.nonzero(self.weights)[:, 0]

    @property
    def weights(self) -> Float[Tensor, "V"]:
        """What each scan counts: the odds that it is right."""
        return torch.tensor(self._odds, dtype=torch.float64)

    @property
    def sure(self) -> Float[Tensor, "V"]:
        """How sure each is of its heading, 0 to 1: `p_pose`, or the confidence without it."""
        stated = [one.confidence if one.p_pose is None else one.p_pose for one in self.said]
        return torch.tensor(stated, dtype=torch.float64).clamp_min(_LEAST_SURE)

    @property
    def shape(self) -> Float[Tensor, "P 3"]:
        """The mean of the canonical shapes."""
        return self._sum / self.weights.sum()

    @property
    def bottom(self) -> Float[Tensor, "3"]:
        """The mean of the single boxes' bottoms, canonical frame."""
        return self._bottoms / self.weights.sum()


@plain_torch()
def complete_together(
    gathered: Gathered,
    config: InferenceConfig = _DEFAULT,
    rays: Rays = (),
    motion: SensorMotion | None = None,
) -> Iterator[Completion]:
    """Completions of a track's single scans made those of one object.

    Args:
        gathered: of two scans or more.
        config: how they are made so.
        rays: that passed the object by, one set a scan, if any are known.
        motion: of the sensor, if known.

    Returns:
        One a scan; each has its points when it is taken.
    """
    done, scans, settings = gathered.done, gathered.scans, gathered.settings
    shape = gathered.shape
    poses = stack([item.pose for item in gathered.said])
    inputs = network_inputs(scans, settings)
    voted = _voted(poses, shape, gathered, inputs, config.track, motion)
    if motion is not None:
        voted = without_leaps(voted, scans, shape, gathered.sure, motion, config.track.outliers)
    mirror, unit = settings.network.mirror, settings.unit
    clouds, start = _in_units(scans, voted, unit)
    fit = refine_checked(clouds, start, gathered.weights, mirror=mirror, config=config.track)
    seen = _seen(clouds, fit.T_sensor_object, mirror, config.track)
    shape = unit * drawn_to(shape[None] / unit, padded([seen]), config.track)[0]
    fit = fit._replace(T_sensor_object=fit.T_sensor_object.scaled(unit))
    body = settings.sensor == "lidar"
    solid = shape
    if any(one is not None for one in rays):
        sights = Sights.of_objects(scans, rays, config.free_space, unit)
        solid = without_free_space(shape, fit.T_sensor_object, sights)
    bottom = gathered.bottom if body else None
    fitted = _box(solid, scans, fit.T_sensor_object, settings, config.box, bottom)
    whole = shape
    if settings.facing:
        whole = denser(shape[None], partners(shape[None], config.refine.partner))[0]
        seen = _shown_by(scans, fit.T_sensor_object, whole, settings, config.track)
        middles, own = whole[len(shape) :].float().numpy(), shape.float().numpy()
        added = shown(middles, own, seen.numpy(), settings, config.refine)
        whole = torch.cat((shape, torch.from_numpy(added).to(shape)))
    cost = track_cost(shape, fit.T_sensor_object, inputs, settings)
    mean = float(np.mean([item.confidence for item in done]))
    reasons = reasons_of_track(done, config.reasons) if body else ()
    trust, evidence = settings.trust, _evidence(gathered, fit.T_sensor_object, fitted, cost)

    def together(i: int) -> Completion:
        said, T_sensor_object = gathered.said[i], fit.T_sensor_object[i]
        item = Completion(
            points=T_sensor_object.apply(whole).float().numpy(),
            pose=T_sensor_object.owned(),
            box=carried(fitted, T_sensor_object),
            confidence=0.0 if said.warning else mean,
            branch=said.branch,
            cost=float(cost[i]),
            refined=fit.refined,
            warning=said.warning,
            reasons=(*said.reasons, *reasons),
            features=said.features,
        )
        return judged(item, trust and trust.track, evidence[i], settings, config.reasons)

    return map(together, range(len(scans)))


def _evidence(
    gathered: Gathered, T_sensor_object: SE3, fitted: FittedBox, cost: Float[Tensor, "V"]
) -> list[TrackFeatures] | list[None]:
    """What is known of each scan of the track; nothing where a completed one brought nothing."""
    if not all(item.evidence for item in gathered.done):
        return [None] * len(gathered.scans)
    length, width, height = fitted.size.tolist()
    size = length, width, height
    return track_features(gathered.done, gathered.rows, T_sensor_object, size, cost)


def _shown_by(
    scans: list[Points],
    T_sensor_object: SE3,
    whole: Float[Tensor, "Q 3"],
    settings: ModelSettings,
    config: TrackConfig,
) -> Float[Tensor, "n 3"]:
    """Points of the scans that can be shown in their object, object frame.

    Depth views that lie farther from it than twice the usual are left out: their poses may be
    wrong. Of a LiDAR's scans only points near it are shown.
    """
    if settings.sensor == "lidar":
        return fused(scans, T_sensor_object, slice(None), config.shown_points)
    each = max(1, config.most_points // len(scans))
    seen = [fused([s], T_sensor_object[i : i + 1], slice(None), each) for i, s in enumerate(scans)]
    target = whole.float()[None]
    off = [float(nearest(one[None], target).distance_squared.sqrt().mean()) for one in seen]
    usual = float(np.median(off))
    return torch.cat([one for one, apart in zip(seen, off) if apart <= _ASTRAY * usual])


def _in_units(scans: list[Points], T_sensor_object: SE3, unit: float) -> tuple[list[Points], SE3]:
    """Both as if the object were as large as a vehicle (`unit_of`)."""
    if unit == 1.0:
        return scans, T_sensor_object
    return [scan / np.float32(unit) for scan in scans], T_sensor_object.scaled(1 / unit)


def _box(
    shape: Float[Tensor, "P 3"],
    scans: list[Points],
    T_sensor_object: SE3,
    settings: ModelSettings,
    config: BoxConfig,
    bottom: Float[Tensor, "3"] | None = None,
) -> FittedBox:
    """One box for all scans of the track, object frame."""
    T_object_sensor = T_sensor_object.inverse()
    seen = (T_object_sensor[i].apply(torch.from_numpy(s).double()) for i, s in enumerate(scans))
    return fit_for(settings, shape, seen, config, bottom)


def _bottom(box: Box) -> Float[Tensor, "1 3"]:
    """The middle of its lower side, its own frame's."""
    down = box.size[2] / 2 * box_axes(box.quaternion_wxyz)[:, 2]
    return torch.from_numpy(np.asarray(box.centre) - down)[None]


def _voted(
    T_sensor_can: SE3,
    shape: Float[Tensor, "P 3"],
    gathered: Gathered,
    inputs: list[NetworkInput],
    config: TrackConfig,
    motion: SensorMotion | None,
) -> SE3:
    """The same poses, all looking one way and no outlier among them."""
    middle = float(shape[:, 0].amin() + shape[:, 0].amax()) / 2
    rotation = T_sensor_can.rotation if motion is None else motion.rotation @ T_sensor_can.rotation
    if slow(rotation, config.vote):
        signs = followed_signs(rotation, gathered.sure, config.vote)
    else:
        gain, links = _votes(T_sensor_can, shape, middle, gathered, inputs, config)
        leaps = gathered.settings.sensor == "lidar" and len(gain) < FEWEST
        signs = voted_signs(gain, links, gathered.sure, config.vote, leaps=leaps)
    turned = turned_where(T_sensor_can, signs, middle)
    between = without_outliers(turned, gathered.scans, shape, gathered.sure, config)
    if between is turned:
        return turned
    own, other = (
        track_cost(shape, poses, inputs, gathered.settings) for poses in (turned, between)
    )
    usual = own[(between.rotation == turned.rotation).all(-1).all(-1)].median()
    better = other - own < gathered.settings.unit * config.outliers.worse_m
    return between.where(better & (own > config.outliers.misfit * usual), turned)


def _votes(
    T_sensor_can: SE3,
    shape: Float[Tensor, "P 3"],
    middle: float,
    gathered: Gathered,
    inputs: list[NetworkInput],
    config: TrackConfig,
) -> tuple[Float[Tensor, "V"], Float[Tensor, "W"]]:
    """What the shape says of each scan, and each scan of the next (`voted_signs`)."""
    settings = gathered.settings
    turned = T_sensor_can @ half_turn(middle)
    stands = track_cost(shape, T_sensor_can, inputs, settings)
    gain = track_cost(shape, turned, inputs, settings) - stands
    unit = settings.unit
    if settings.sensor == "lidar":
        links = nearness_of_next(T_sensor_can.inverse().translation, middle, config.vote)
    else:
        some = torch.from_numpy(sampled(gathered.scans, config.voting_points))
        clouds = T_sensor_can.inverse().apply(some.double()).float() / unit
        mirror = settings.network.mirror
        links = likeness_of_next(clouds, middle / unit, mirror=mirror, config=config.vote)
    return gain / unit, links


def _seen(
    scans: list[Points], T_sensor_object: SE3, mirror: bool, config: TrackConfig
) -> Float[Tensor, "n 3"]:
    """The surface that the scans saw, reflected and thinned to an even density, object frame."""
    points = fused(scans, T_sensor_object, slice(None), config.most_points)
    points = mirrored(points[None])[0] if mirror else points
    return torch.from_numpy(voxel_thin(points.numpy(), config.voxel_m))
