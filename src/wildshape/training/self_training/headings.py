# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""All tracks agree on which way is front (beyond the paper), without a label.

A near-symmetric object settles in either of two headings, a half turn apart, each track as chance
has it (METHOD 12). What needs no label decides: within a track an object does not turn around
between neighbouring scans, or, where the scans come in no order (`LossConfig.time_ordered` is
false), they contradict each other if not posed alike (`heading_overlaps.py`); across tracks, the
profiles of fused scans are more alike when turned the same way (`heading_profiles.py`). Each is a
problem of signs (Z2 synchronisation), solved by a leading eigenvector. Which of the two ways is
called front stays open: nobody says.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.tracks.heading_vote import continuous_signs, turned_where
from wildshape.method.choose_hypothesis import CostRule, choose_hypothesis
from wildshape.method.multiview import LossConfig
from wildshape.method.network import ShapePoseNet
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.heading_contradictions import (
    ContradictionConfig,
    EndOn,
    end_on,
    own_signs,
    uncontradicted_signs,
)
from wildshape.training.self_training.heading_overlaps import OverlapConfig, agreeing_signs
from wildshape.training.self_training.heading_profiles import (
    ProfileConfig,
    Profiles,
    agreed_signs,
    profile,
    together,
)

_BATCH = 64  # scans at once; decides memory alone


@dataclass(frozen=True)
class HeadingConfig:
    """How headings are agreed on.

    Attributes:
        scan_points: of each scan, where scans and tracks are compared.
    """

    scan_points: int = 256
    overlap: OverlapConfig = field(default_factory=OverlapConfig)
    profile: ProfileConfig = field(default_factory=ProfileConfig)
    contradiction: ContradictionConfig = field(default_factory=ContradictionConfig)


_DEFAULT = HeadingConfig()


class PosedTrack(NamedTuple):
    """A track's scans and their poses, as recorded.

    Attributes:
        scans: rows of the store.
        T_sensor_can: one a scan.
        middle_x: of the object's length in the canonical frame, metres.
    """

    scans: np.ndarray
    T_sensor_can: SE3
    middle_x: float

    def turned(self, signs: Float[Tensor, "V"]) -> "PosedTrack":
        """The scans of sign -1 turned by half a turn about the object's middle."""
        return self._replace(T_sensor_can=turned_where(self.T_sensor_can, signs, self.middle_x))


@torch.no_grad()
def agreed_rotations(
    network: ShapePoseNet,
    sampler: ViewSampler,
    loss: LossConfig,
    config: HeadingConfig = _DEFAULT,
) -> Float[Tensor, "S 3 3"]:
    """`R_sensor_canonical` of every scan of a store, as recorded, once all tracks look one way.

    Zero for scans that are not trained on.

    Args:
        network: poses the scans; its weights are finite.
        sampler: of the tracks trained on.
        loss: decides which branch speaks, and whether the scans of a track follow each other.
        config: how headings are agreed on.
    """
    posed = [pose_track(network, sampler, loss, scans) for scans in sampler.scans_of]
    ordered, mirror = loss.time_ordered, network.config.mirror
    votes = [
        signs_within(sampler, track, config, time_ordered=ordered, mirror=mirror) for track in posed
    ]
    tracks = [track.turned(signs) for track, signs in zip(posed, votes)]
    clouds = [some_of_each(sampler, track, config.scan_points).flatten(0, 1) for track in tracks]
    profiles = together([profile(cloud, config.profile) for cloud in clouds])
    tracks = turned_as_wholes(tracks, signs_across(profiles, votes, config.profile))
    return by_scan(tracks, len(sampler.store.scan_sizes)).rotation


@torch.no_grad()
def pose_track(
    network: ShapePoseNet, sampler: ViewSampler, rule: CostRule, scans: np.ndarray
) -> PosedTrack:
    """A track's scans as the network poses them, each under its own shape.

    Args:
        network: poses the scans.
        sampler: prepares scans as the network was trained on them.
        rule: what a hypothesis costs.
        scans: rows of the store.
    """
    rng = np.random.default_rng(0)
    device = next(network.parameters()).device
    found, middles = [], []
    for start in range(0, len(scans), _BATCH):
        rows = [int(s) for s in scans[start : start + _BATCH]]
        inputs, centres, turn = (t.to(device) for t in sampler.gather_as_posed(rows, rng))
        said = choose_hypothesis(network, inputs, centres, rule)
        chosen, x = said.pose, said.shapes[..., 0]
        translation = (turn.mT @ (chosen.translation[:, 0] + centres)[..., None])[..., 0]
        middles.append((x.amin(1) + x.amax(1)) / 2)
        found.append(((turn.mT @ chosen.rotation[:, 0]).cpu(), translation.cpu()))
    rotations, translations = zip(*found)
    middle_x = float(torch.cat(middles).median())
    return PosedTrack(scans, SE3(torch.cat(rotations), torch.cat(translations)), middle_x)


def signs_within(
    sampler: ViewSampler,
    track: PosedTrack,
    config: HeadingConfig = _DEFAULT,
    *,
    time_ordered: bool,
    mirror: bool,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each of a track's scans: turn those of -1 and they look one way, whichever.

    Args:
        sampler: gives the scans.
        track: posed.
        config: how headings are agreed on.
        time_ordered: the scans follow each other.
        mirror: the object is symmetric in the plane y = 0.
    """
    if time_ordered:
        return continuous_signs(track.T_sensor_can.rotation)
    clouds = some_of_each(sampler, track, config.scan_points)
    sensors = track.T_sensor_can.inverse().translation
    return agreeing_signs(clouds, sensors, track.middle_x, config.overlap, mirror=mirror)


def signs_across(
    profiles: Profiles, votes: Sequence[Float[Tensor, "_"]], config: ProfileConfig
) -> Float[Tensor, "J"]:
    """+1 or -1 for each track: turn those of -1 and all look one way.

    Of the two ways that all may look, it is the one that most scans look already.

    Args:
        profiles: of the tracks.
        votes: +1 for each scan of a track that looked, as the network posed it, as the track does.
        config: how alike tracks are.
    """
    signs = agreed_signs(profiles, config)
    looks = torch.stack([(own * sign).sum() for own, sign in zip(votes, signs)]).sum()
    return signs * torch.where(looks < 0, -1.0, 1.0)


def settled_signs(
    tracks: Sequence[PosedTrack],
    votes: Sequence[Float[Tensor, "_"]],
    profiles: Profiles,
    signs: Float[Tensor, "J"],
    config: HeadingConfig = _DEFAULT,
) -> Float[Tensor, "J"]:
    """The signs of tracks as a network trained to its end would have them.

    What it says of a scan is worth something against what all tracks together say.

    Args:
        tracks: before `signs`.
        votes: as in `signs_across`.
        profiles: of the tracks.
        signs: agreed on by profiles.
        config: how headings are agreed on.
    """
    rule = config.contradiction
    counts = [
        end_on(own, track.T_sensor_can.inverse().translation, sign, rule)
        for track, own, sign in zip(tracks, votes, signs)
    ]
    seen = EndOn(*(torch.cat(parts) for parts in zip(*counts)))
    signs = uncontradicted_signs(profiles, signs, seen, rule, config.profile)
    return own_signs(signs, list(votes), rule)


def turned_as_wholes(tracks: Sequence[PosedTrack], signs: Float[Tensor, "J"]) -> list[PosedTrack]:
    """The tracks, all scans of those of sign -1 turned."""
    return [t.turned(sign.expand(len(t.scans))) for t, sign in zip(tracks, signs)]


def by_scan(tracks: Sequence[PosedTrack], scans: int) -> SE3:
    """`T_sensor_canonical` of every scan of the store, float32; zeros for those of no track."""
    rotation, translation = torch.zeros(scans, 3, 3), torch.zeros(scans, 3)
    for track in tracks:
        rows = torch.from_numpy(track.scans)
        rotation[rows] = track.T_sensor_can.rotation.float()
        translation[rows] = track.T_sensor_can.translation.float()
    return SE3(rotation, translation)


def some_of_each(sampler: ViewSampler, track: PosedTrack, count: int) -> Float[Tensor, "V n 3"]:
    """So many points of each of a track's scans, in the canonical frame."""
    rng = np.random.default_rng(0)
    clouds = []
    for index, scan in enumerate(track.scans):
        points = sampler.store.scan_points(int(scan))
        picked = torch.from_numpy(points[rng.integers(len(points), size=count)])
        clouds.append(track.T_sensor_can[index].inverse().apply(picked))
    return torch.stack(clouds)
