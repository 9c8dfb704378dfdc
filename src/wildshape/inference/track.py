# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One object from all scans of its track: headings voted, poses refined, one shape (METHOD 11).

Beyond the paper. Each scan was completed on its own first; here they are held against each other.
Nothing but the scans and what the network said of each is used.
"""

from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.box import FittedBox
from wildshape.geometry.outliers import voxel_thin
from wildshape.geometry.se3 import SE3, stack
from wildshape.inference.astray import steadied
from wildshape.inference.boxes import carried, fit_to_scans
from wildshape.inference.joint import FINE, refine_jointly, stayed_near
from wildshape.inference.pose_graph import refine_by_graph
from wildshape.inference.prepare import network_input, unit_of
from wildshape.inference.refine import denser
from wildshape.inference.voting import (
    half_turn,
    likeness_of_next,
    nearness_of_next,
    turned_where,
    voted_signs,
)
from wildshape.losses.hindsight import score_hypotheses
from wildshape.models.checkpoint import ModelSettings
from wildshape.ops.nearest import nearest
from wildshape.records import Completion, Points

_BATCH, _MOST_POINTS, _VOTING_POINTS = 32, 4096, 192
_VOXEL_M, _REACH_M, _STIFFNESS = 0.08, 0.12, 0.2


Refine = Literal["joint", "graph"]
"""All scans onto each other at once; or, before and after that, each onto its neighbours."""


class TrackFit(NamedTuple):
    """Poses of one object in a track's scans.

    Attributes:
        T_sensor_object: of every scan.
        refined: whether they were made to fit each other.
    """

    T_sensor_object: SE3
    refined: bool


@torch.inference_mode()
def complete_together(
    done: list[Completion],
    scans: list[Points],
    settings: ModelSettings,
    *,
    refine: Refine = "joint",
) -> list[Completion]:
    """Completions of a track's single scans made those of one object.

    Args:
        done: each scan on its own.
        scans: of one rigid object, in time order, sensor frames.
        settings: of the network that completed them.
        refine: how the poses are made to fit each other.
    """
    if len(done) < 2:
        return done
    weights = torch.tensor([max(item.confidence, 1e-3) for item in done], dtype=torch.float64)
    shape = _mean_shape(done, weights, settings.network.points)
    voted = _voted(stack([item.pose for item in done]), shape, weights, scans, settings)
    mirror, unit = settings.network.mirror, unit_of(settings.extent_m[1])
    given, start = _in_units(scans, voted, unit)
    fit = refine_checked(given, start, mirror=mirror, refine=refine)
    shape = unit * drawn_to(shape / unit, _seen(given, fit.T_sensor_object, mirror))
    fit = fit._replace(T_sensor_object=_scaled(fit.T_sensor_object, unit))
    fitted = _box(shape, scans, fit.T_sensor_object, mirror=mirror)
    whole = torch.from_numpy(denser(shape.numpy())) if settings.facing else shape
    cost = track_cost(shape, fit.T_sensor_object, scans, settings)
    confidence = float(np.mean([item.confidence for item in done]))
    return [
        replace(
            item,
            points=fit.T_sensor_object[i].apply(whole).float().numpy(),
            pose=fit.T_sensor_object[i],
            box=carried(fitted, fit.T_sensor_object[i]),
            confidence=0.0 if item.warning else confidence,
            cost=float(cost[i]),
            refined=fit.refined,
        )
        for i, item in enumerate(done)
    ]


def _in_units(scans: list[Points], T_sensor_object: SE3, unit: float) -> tuple[list[Points], SE3]:
    """Both as if the object were as large as a vehicle (`unit_of`)."""
    if unit == 1.0:
        return scans, T_sensor_object
    return [scan / np.float32(unit) for scan in scans], _scaled(T_sensor_object, 1 / unit)


def _scaled(T_a_b: SE3, factor: float) -> SE3:
    return SE3(T_a_b.rotation, T_a_b.translation * factor)


def _box(
    shape: Float[Tensor, "P 3"], scans: list[Points], T_sensor_object: SE3, *, mirror: bool
) -> FittedBox:
    """One box for all scans of the track, object frame."""
    T_object_sensor = T_sensor_object.inverse()
    seen = [T_object_sensor[i].apply(torch.from_numpy(s).double()) for i, s in enumerate(scans)]
    return fit_to_scans(shape, seen, mirror=mirror)


def _mean_shape(
    done: list[Completion], weights: Float[Tensor, "V"], count: int
) -> Float[Tensor, "P 3"]:
    """The mean of the canonical shapes: points of one index are the same place of the object.

    That holds for the network's own `count` points, which come first.
    """
    points = [torch.from_numpy(item.points[:count]).double() for item in done]
    shapes = [item.pose.inverse().apply(of) for item, of in zip(done, points)]
    return (torch.stack(shapes) * weights[:, None, None]).sum(0) / weights.sum()


def _voted(
    T_sensor_can: SE3,
    shape: Float[Tensor, "P 3"],
    weights: Float[Tensor, "V"],
    scans: list[Points],
    settings: ModelSettings,
) -> SE3:
    """The same poses, all looking one way and none astray."""
    middle = float(shape[:, 0].amin() + shape[:, 0].amax()) / 2
    turned = T_sensor_can @ half_turn(middle)
    stands = track_cost(shape, T_sensor_can, scans, settings)
    gain = track_cost(shape, turned, scans, settings) - stands
    unit = unit_of(settings.extent_m[1])
    if settings.sensor == "lidar":
        links = nearness_of_next(T_sensor_can.inverse().translation, middle)
    else:
        clouds = _some_of_each(scans, T_sensor_can) / unit
        links = likeness_of_next(clouds, middle / unit, mirror=settings.network.mirror)
    signs = voted_signs(T_sensor_can.rotation, gain / unit, links, weights)
    return steadied(turned_where(T_sensor_can, signs, middle))


def _some_of_each(scans: list[Points], T_sensor_object: SE3) -> Float[Tensor, "V n 3"]:
    """As many points of each scan, object frame."""
    rng = np.random.default_rng(0)
    rows = [rng.permutation(len(s))[np.arange(_VOTING_POINTS) % len(s)] for s in scans]
    picked = torch.stack([torch.from_numpy(s[row]) for s, row in zip(scans, rows)])
    return T_sensor_object.inverse().apply(picked.double()).float()


def track_cost(
    shape: Float[Tensor, "P 3"], T_sensor_object: SE3, scans: list[Points], settings: ModelSettings
) -> Float[Tensor, "V"]:
    """The label-free cost of one shape in every scan, metres (METHOD 6)."""
    found = []
    for start in range(0, len(scans), _BATCH):
        part = slice(start, start + _BATCH)
        given = network_input(scans[part], settings.input_points, settings.sensor, settings.facing)
        posed = T_sensor_object[part].apply(shape.expand(len(given.scans), -1, -1)).float()
        posed = posed @ given.turn.mT - given.centres[:, None]
        scores = score_hypotheses(given.scans, given.centres, posed[:, None], settings.projection)
        found.append(scores.cost(settings.beta)[:, 0])
    return torch.cat(found).double()


def refine_checked(
    scans: list[Points], voted: SE3, *, mirror: bool, refine: Refine = "joint"
) -> TrackFit:
    """Refined poses, kept only if the scans then lie nearer to each other, and near the vote."""
    refined = refine_by_graph(scans, voted) if refine == "graph" else voted
    refined = refine_jointly(scans, refined, mirror=mirror)
    refined = refine_jointly(scans, refined, mirror=False, schedule=FINE)
    refined = refine_by_graph(scans, refined) if refine == "graph" else refined
    near = stayed_near(voted, refined)
    if near and _disagreement(scans, refined, mirror) < _disagreement(scans, voted, mirror):
        return TrackFit(refined, refined=True)
    return TrackFit(voted, refined=False)


def _disagreement(scans: list[Points], T_sensor_object: SE3, mirror: bool) -> float:
    """Mean distance of every other scan to those between them, metres, each at most 40 cm."""
    halves = [
        _fused(scans, T_sensor_object, part) for part in (slice(0, None, 2), slice(1, None, 2))
    ]
    bank = _with_mirror(halves[1]) if mirror else halves[1]
    found = nearest(halves[0][None], bank[None])
    return float(found.distance_squared.sqrt().clamp_max(0.4).mean())


def _fused(scans: list[Points], T_sensor_object: SE3, part: slice) -> Float[Tensor, "n 3"]:
    """Points of some of the scans in the object frame, at most a few thousand."""
    rng = np.random.default_rng(0)
    chosen = range(len(scans))[part]
    most = max(1, _MOST_POINTS // len(chosen))
    clouds = []
    for i in chosen:
        points = torch.from_numpy(scans[i][rng.permutation(len(scans[i]))[:most]]).double()
        clouds.append(T_sensor_object[i].inverse().apply(points))
    return torch.cat(clouds).float()


def _with_mirror(points: Float[Tensor, "n 3"]) -> Float[Tensor, "m 3"]:
    return torch.cat((points, points * points.new_tensor((1.0, -1.0, 1.0))))


def _seen(scans: list[Points], T_sensor_object: SE3, mirror: bool) -> Float[Tensor, "n 3"]:
    """The surface that the scans saw, reflected and thinned to an even density, object frame."""
    fused = _fused(scans, T_sensor_object, slice(None))
    fused = _with_mirror(fused) if mirror else fused
    return torch.from_numpy(voxel_thin(fused.numpy(), _VOXEL_M))


def drawn_to(shape: Float[Tensor, "P 3"], seen: Float[Tensor, "n 3"]) -> Float[Tensor, "P 3"]:
    """The shape's points drawn to the mean of what was seen around them; the others stay.

    Args:
        shape: object frame.
        seen: points of even density, the same frame.
    """
    moved = []
    for part in shape.float().split(1024):
        apart = torch.cdist(part, seen) / _REACH_M
        weight = torch.exp(-apart.square())
        total = weight.sum(1, keepdim=True) + _STIFFNESS
        moved.append((weight @ seen + _STIFFNESS * part) / total)
    return torch.cat(moved).to(shape.dtype)
