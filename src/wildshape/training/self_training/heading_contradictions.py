# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of objects that look the other way than all others, found by the views that do not agree.

Beyond the paper. Seen from the side, a pickup turned round looks more like a sedan than as it is:
its cabin sits on the other half. Tracks that agree by their profiles (`heading_profiles.py`) then
turn all pickups round, and a network learns it. But seen end-on, where no profile shows, a front is
a front, and the network calls some of these scans turned against what it was taught of them. Where
it contradicts itself so in the end-on views of an object and of those most like it, far more often
than elsewhere, the kind is turned.
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.training.self_training.heading_profiles import (
    ProfileConfig,
    Profiles,
    nearest_profiles,
    reversed_where,
)


@dataclass(frozen=True)
class ContradictionConfig:
    """When a network's word about end-on views counts for more than the profiles.

    Attributes:
        neighbours: objects most like one, itself among them, that make its kind.
        share: of a kind's end-on views the network must call turned.
        times: so many times as large a share as of all objects, for networks contradict themselves.
        fewest: a kind seen end-on in fewer scans says nothing.
        majority: share of an object's kind that must be contradicted for it to be turned.
        end_on_cosine: of the largest angle between the line of sight and the object; 25 degrees.
        settled: largest share of scans against most of their track at which a network is settled.
        clear: a settled network decides where its mean vote, -1 to 1, is at least this large.
    """

    neighbours: int = 20
    share: float = 0.125
    times: float = 3.0
    fewest: int = 10
    majority: float = 0.5
    end_on_cosine: float = 0.9063
    settled: float = 0.08
    clear: float = 0.5


_DEFAULT = ContradictionConfig()
_PROFILES = ProfileConfig()


class EndOn(NamedTuple):
    """How often a network contradicted the heading of a track, seen along its length.

    Attributes:
        opposed: scans called turned round, seen from +x and from -x.
        all: scans seen from there.
    """

    opposed: Float[Tensor, "J 2"]
    all: Float[Tensor, "J 2"]


def own_signs(
    signs: Float[Tensor, "J"],
    votes: list[Float[Tensor, "_"]],
    config: ContradictionConfig = _DEFAULT,
) -> Float[Tensor, "J"]:
    """The signs, or the network's own where it is clear about a track, and in general.

    Args:
        signs: agreed on by profiles, contradicted kinds reversed.
        votes: of each track, +1 where the network's own heading of a scan is that of the track's
            frame, else -1.
        config: `settled` is clear in general, `clear` about a track.
    """
    mean = torch.stack([vote.mean() for vote in votes])
    scans = torch.tensor([float(len(vote)) for vote in votes])
    contradicting = float((scans * (1 - mean.abs()) / 2).sum() / scans.sum())
    if contradicting > config.settled:
        return signs
    return torch.where(mean.abs() >= config.clear, mean.sign().to(signs.dtype), signs)


def end_on(
    vote: Float[Tensor, "V"],
    sensors: Float[Tensor, "V 3"],
    sign: Float[Tensor, ""],
    config: ContradictionConfig = _DEFAULT,
) -> EndOn:
    """The counts of one track, J = 1.

    Args:
        vote: +1 where the network's own heading of a scan is that of `sensors`' frame, else -1.
        sensors: from where each scan was taken, in the object's frame before `sign`.
        sign: -1 if the track is to be turned.
        config: what is end-on.
    """
    along = sign * sensors[:, 0] / sensors[:, :2].norm(dim=1).clamp_min(1e-6)
    seen = torch.stack((along > config.end_on_cosine, along < -config.end_on_cosine), dim=1)
    opposed = seen & (vote * sign < 0)[:, None]
    return EndOn(opposed.sum(0, keepdim=True).float(), seen.sum(0, keepdim=True).float())


def uncontradicted_signs(
    profiles: Profiles,
    signs: Float[Tensor, "J"],
    found: EndOn,
    config: ContradictionConfig = _DEFAULT,
    likeness: ProfileConfig = _PROFILES,
) -> Float[Tensor, "J"]:
    """The signs, those of contradicted kinds reversed.

    Args:
        profiles: of the tracks, before `signs`.
        signs: agreed on by profiles.
        found: counts after `signs`.
        config: what contradicts a kind.
        likeness: how unlike two profiles are.
    """
    turned = reversed_where(profiles, signs < 0)
    near = nearest_profiles(turned, config.neighbours, likeness)
    opposed, seen = found.opposed[near].sum(1), found.all[near].sum(1)
    share = torch.where(seen >= config.fewest, opposed / seen.clamp_min(1), 0.0).amax(1)
    usual = found.opposed.sum() / found.all.sum().clamp_min(1)
    contradicted = share > torch.clamp(config.times * usual, min=config.share)
    kind = contradicted[near].float().mean(1) > config.majority
    return torch.where(kind, -signs, signs)
