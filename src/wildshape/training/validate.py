# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Held-out figures: the loss terms and cycle consistency without truth, and with it if there is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from wildshape.evaluation import protocol
from wildshape.evaluation.results import Limits
from wildshape.evaluation.summary import figures_of
from wildshape.geometry.gravity import mean_up
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.evaluation_adapter import Learned
from wildshape.inference.predictor import Predictor
from wildshape.io.store.store import Store
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.choose_hypothesis import choose_hypothesis
from wildshape.method.multiview import LossConfig, multiview_loss
from wildshape.method.network import Poses, ShapePoseNet
from wildshape.training.batches.views import Batch, ViewSampler
from wildshape.training.config import ValidationConfig

_SEED = 20_200_823
_TRUTH = ("cd", "acc30", "rot_median_deg", "trans_median_m")


@dataclass(frozen=True)
class Validation:
    """Label-free figures on held-out tracks.

    Attributes:
        observation: first term under multi-view consistency, metres.
        projection: second term, metres.
        cost_median: median label-free cost of a scan under its own shape, metres.
        cost_p90: its 90th percentile.
        cycle_deg: median angle, degrees, between the pose of scan b and the pose predicted for
            scan a after it was registered to b: a registered scan must be posed as its target.
    """

    observation: float
    projection: float
    cost_median: float
    cost_p90: float
    cycle_deg: float


def truth_figures(
    network: ShapePoseNet,
    settings: ModelSettings,
    store: Store,
    tracks: Sequence[int] | np.ndarray,
    turn: Literal["none", "yaw", "so3"],
    config: ValidationConfig,
) -> dict[str, float]:
    """Registration and completion of held-out tracks against their truth, where they have it.

    A view on the run for those who look; nothing is chosen by it. None without scipy, which
    evaluation needs, but training does not.

    Args:
        network: in evaluation.
        settings: of the checkpoint.
        store: holds the tracks.
        tracks: indices; the first few that have poses are used.
        turn: rotation protocol of METHOD 8, that of training.
        config: how many tracks and scans.
    """
    known = [int(t) for t in tracks if store.poses_of(int(t)) is not None]
    known = known[: config.truth_tracks]
    if not known or not find_spec("scipy"):
        return {}
    method = {"held out": Learned(Predictor(network, settings))}
    found = protocol.run(
        method,
        (store.track(t) for t in known),
        turn,
        _SEED,
        limits=Limits(max_scans=config.truth_scans),
    )
    figures = figures_of(found["held out"])
    return {
        f"truth_{name}": float(value) for name in _TRUTH if (value := figures[name]) is not None
    }


def usual_up(
    network: ShapePoseNet, settings: ModelSettings, sampler: ViewSampler, tracks: int
) -> tuple[float, float, float] | None:
    """Which way is up in the canonical frame, as LiDARs that are held level say; None if none is.

    Of a mirror-symmetric network it lies in the mirror plane.

    Args:
        network: in evaluation.
        settings: of the checkpoint.
        sampler: of held-out tracks.
        tracks: so many of them; their middle scans are posed.
    """
    if settings.sensor != "lidar" or not settings.facing:
        return None
    middles = [int(scans[len(scans) // 2]) for scans in sampler.scans_of[:tracks]]
    scans = [sampler.store.scan_points(middle) for middle in middles]
    up = mean_up(Predictor(network, settings, raw=True).poses(scans).rotation)
    if up is None:
        return None
    x, y, z = up.tolist()
    if network.config.mirror:
        x, y, z = x / math.hypot(x, z), 0.0, z / math.hypot(x, z)
    return x, y, z


@torch.no_grad()
def validate(
    network: ShapePoseNet, sampler: ViewSampler, config: LossConfig, batches: int, device: str
) -> Validation:
    """The figures over a fixed set of batches of held-out tracks."""
    rows = [
        _figures(network, sampler, config, batch.to(device))
        for batch in (sampler.draw(_SEED, index) for index in range(batches))
    ]
    observation, projection, cost, cycle = (torch.cat(part) for part in zip(*rows))
    return Validation(
        float(observation.mean()),
        float(projection.mean()),
        float(cost.median()),
        float(cost.quantile(0.9)),
        float(torch.rad2deg(cycle).median()),
    )


def _figures(
    network: ShapePoseNet, sampler: ViewSampler, config: LossConfig, batch: Batch
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    own = choose_hypothesis(network, batch.scans, batch.centres, config)
    reference = own.shapes[batch.reference]
    terms = multiview_loss(
        batch.scans, batch.centres, reference, own.poses.rotation, own.poses.translation, config
    )
    cycle = _cycle_angle(network, sampler, config, batch, own.pose)
    return terms.observation[None], terms.projection[None], own.cost(config.beta), cycle


def _cycle_angle(
    network: ShapePoseNet, sampler: ViewSampler, config: LossConfig, batch: Batch, poses: Poses
) -> Tensor:
    """Scan a of each track registered to its neighbour b, posed again, against b's pose."""
    views = sampler.config.views
    T_centred_can = SE3(poses.rotation[:, 0], poses.translation[:, 0])
    T_sensor_can = SE3(T_centred_can.rotation, T_centred_can.translation + batch.centres)
    target = torch.arange(len(batch.scans), device=batch.scans.device)
    target = target // views * views + (target + 1) % views
    T_b_a = T_sensor_can[target] @ T_sensor_can.inverse()
    moved = T_b_a.apply(batch.scans + batch.centres[:, None])
    # Turned and centred as a scan to be posed is, not as it lies in the batch.
    centred, centres, turn = sampler.as_posed(moved)
    chosen = choose_hypothesis(network, centred, centres, config).pose
    again = turn.mT @ chosen.rotation[:, 0]
    return SE3(poses.rotation[target, 0].mT @ again, centres).angle()
