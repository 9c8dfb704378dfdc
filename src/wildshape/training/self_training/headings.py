# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""All tracks agree on which way is front (beyond the paper), without a label.

A near-symmetric object settles in either of two headings, a half turn apart, each track as chance
has it (METHOD 12.2). Facts that need no label decide: within a track an object does not turn
around between neighbouring scans, or, where the scans come in no order (`LossConfig.time_ordered`
is false), they contradict each other if not posed alike (`heading_overlaps.py`); across tracks, the
profiles of fused scans are more alike when turned the same way (`heading_profiles.py`). Each is a
problem of signs (Z2 synchronisation), solved by a leading eigenvector. Which of the two ways is
called front stays open: nobody says.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.choose_hypothesis import choose_hypothesis
from wildshape.inference.tracks.heading_vote import continuous_signs, turned_where
from wildshape.method.multiview import LossConfig
from wildshape.method.network import ShapePoseNet
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.heading_contradictions import (
    EndOn,
    end_on,
    own_signs,
    uncontradicted_signs,
)
from wildshape.training.self_training.heading_overlaps import agreeing_signs
from wildshape.training.self_training.heading_profiles import agreed_signs, profile, together

NOT_FINITE = (
    "training stopped: the loss is not finite; resume from the last checkpoint with a smaller"
    " learning rate, or check the data's units."
)
_BATCH, _POINTS = 64, 256


class AgreedPoses(NamedTuple):
    """`T_sensor_canonical` of every scan of a store, as recorded, headings agreed on.

    Attributes:
        rotation: zero for unused scans.
        translation: metres; zero for unused scans.
    """

    rotation: Float[Tensor, "S 3 3"]
    translation: Float[Tensor, "S 3"]


@torch.no_grad()
def agreed_poses(
    network: ShapePoseNet,
    sampler: ViewSampler,
    config: LossConfig,
    refined: Callable[[np.ndarray, SE3], SE3] = lambda _, pose: pose,
    progress: Callable[[int, int], None] = lambda *_: None,
    fused: Callable[[ViewSampler, np.ndarray, SE3], Tensor] | None = None,
    transferred: Callable[[np.ndarray, SE3], Tensor] | None = None,
    *,
    settled: bool = False,
) -> AgreedPoses:
    """Pose all scans, refine each track, and let all tracks look one way.

    Args:
        network: poses the scans.
        sampler: of the tracks trained on.
        config: decides which branch speaks, and whether the scans of a track follow each other.
        refined: from a track's scans and their poses to better poses.
        progress: called with the tracks done, and their number.
        fused: a track's object from its scans and their poses, to be compared with others; by
            default some points of each scan.
        transferred: from a track's scans and their poses to +1 or -1 for each, as someone else
            would have it look (`heading_transfer.py`); then nothing need be agreed on.
        settled: the network has been trained to its end: what it says of a scan is worth something
            against what all tracks together say (`heading_contradictions.py`).

    Raises:
        BadInputError: the network's weights are no longer finite.
    """
    if not all(bool(torch.isfinite(p).all()) for p in network.parameters()):
        raise BadInputError(NOT_FINITE)
    count = len(sampler.store.scan_sizes)
    agreed = AgreedPoses(torch.zeros(count, 3, 3), torch.zeros(count, 3))
    profiles, kept, middles = [], [], []
    fused = fused or _fused
    for done, scans in enumerate(sampler.scans_of):
        T_sensor_can, middle_x = _poses(network, sampler, config, scans)
        if transferred is not None:
            votes = transferred(scans, T_sensor_can)
        else:
            mirror = network.config.mirror
            votes = _own_signs(sampler, config, scans, T_sensor_can, middle_x, mirror=mirror)
        T_voted_can = refined(scans, turned_where(T_sensor_can, votes, middle_x))
        rows = torch.from_numpy(scans)
        agreed.rotation[rows] = T_voted_can.rotation
        agreed.translation[rows] = T_voted_can.translation
        if transferred is None:
            profiles.append(profile(fused(sampler, scans, T_voted_can)))
        kept.append(votes)
        middles.append(middle_x)
        progress(done + 1, len(sampler.scans_of))
    if transferred is not None:
        return agreed
    all_profiles = together(profiles)
    signs = agreed_signs(all_profiles)
    # Of the two ways that all may look, take the one that most scans look already.
    looks = torch.stack([(s * sign).sum() for s, sign in zip(kept, signs)]).sum()
    signs = signs * torch.where(looks < 0, -1.0, 1.0)
    if settled:
        found = [_end_on(agreed, *one) for one in zip(sampler.scans_of, kept, signs)]
        counts = EndOn(*(torch.cat(parts) for parts in zip(*found)))
        signs = own_signs(uncontradicted_signs(all_profiles, signs, counts), kept)
    for scans, sign, middle_x in zip(sampler.scans_of, signs, middles):
        rows = torch.from_numpy(scans)
        given = SE3(agreed.rotation[rows], agreed.translation[rows])
        turned = turned_where(given, sign.expand(len(rows)), middle_x)
        agreed.rotation[rows], agreed.translation[rows] = turned.rotation, turned.translation
    return agreed


def _own_signs(
    sampler: ViewSampler,
    config: LossConfig,
    scans: np.ndarray,
    T_sensor_can: SE3,
    middle_x: float,
    *,
    mirror: bool,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each of a track's scans, so that they look one way, whichever."""
    if config.time_ordered:
        return continuous_signs(T_sensor_can.rotation)
    clouds = some_of_each(sampler, scans, T_sensor_can)
    sensors = T_sensor_can.inverse().translation
    return agreeing_signs(clouds, sensors, middle_x, mirror=mirror)


def _end_on(
    poses: AgreedPoses, scans: np.ndarray, votes: Float[Tensor, "V"], sign: Float[Tensor, ""]
) -> EndOn:
    """How the network's own headings of one track's scans stand against the track's."""
    rows = torch.from_numpy(scans)
    T_sensor_can = SE3(poses.rotation[rows], poses.translation[rows])
    return end_on(votes, T_sensor_can.inverse().translation, sign)


def _poses(
    network: ShapePoseNet, sampler: ViewSampler, config: LossConfig, scans: np.ndarray
) -> tuple[SE3, float]:
    """`T_sensor_canonical` of scans as recorded, each under its own shape; the shapes' middle x."""
    rng = np.random.default_rng(0)
    device = next(network.parameters()).device
    found, middles = [], []
    for start in range(0, len(scans), _BATCH):
        rows = [int(s) for s in scans[start : start + _BATCH]]
        inputs, centres, turn = (t.to(device) for t in sampler.gather_as_posed(rows, rng))
        said = choose_hypothesis(network, inputs, centres, config)
        chosen, x = said.pose, said.shapes[..., 0]
        translation = (turn.mT @ (chosen.translation[:, 0] + centres)[..., None])[..., 0]
        middles.append((x.amin(1) + x.amax(1)) / 2)
        found.append(((turn.mT @ chosen.rotation[:, 0]).cpu(), translation.cpu()))
    rotations, translations = zip(*found)
    middle_x = float(torch.cat(middles).median())
    return SE3(torch.cat(rotations), torch.cat(translations)), middle_x


def _fused(sampler: ViewSampler, scans: np.ndarray, T_sensor_can: SE3) -> Float[Tensor, "n 3"]:
    """The object of a track, roughly."""
    return some_of_each(sampler, scans, T_sensor_can).flatten(0, 1)


def some_of_each(
    sampler: ViewSampler, scans: np.ndarray, T_sensor_can: SE3
) -> Float[Tensor, "V n 3"]:
    """A few hundred points of each of a track's scans, in the canonical frame."""
    rng = np.random.default_rng(0)
    clouds = []
    for index, scan in enumerate(scans):
        points = sampler.store.scan_points(int(scan))
        picked = torch.from_numpy(points[rng.integers(len(points), size=_POINTS)])
        clouds.append(T_sensor_can[index].inverse().apply(picked))
    return torch.stack(clouds)
