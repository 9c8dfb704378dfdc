# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Kinds of objects that look the other way than all others, found by the views that do not agree.

Beyond the paper. Seen from the side, a pickup turned round looks more like a saloon car than as it
is: its cabin sits on the other half. Tracks that agree by their profiles (`heading_profiles.py`)
then turn all pickups round, and a network learns it. But seen end-on, where no profile shows, a
front is a front, and the network calls some of these scans turned against what it was taught of
them. Where it contradicts itself so in the end-on views of an object and of those most like it, far
more often than elsewhere, the kind is turned.
"""

from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.training.self_training.heading_profiles import Profiles, difference, reversed_where

_NEIGHBOURS, _SHARE, _TIMES, _FEWEST, _HALF = 20, 0.125, 3.0, 10, 0.5
_END_ON = 0.9063  # cosine of 25 degrees
_SETTLED, _CLEAR = 0.08, 0.5


class EndOn(NamedTuple):
    """How often a network contradicted the heading of a track, seen along its length.

    Attributes:
        opposed: scans called turned round, seen from +x and from -x.
        all: scans seen from there.
    """

    opposed: Float[Tensor, "J 2"]
    all: Float[Tensor, "J 2"]


def own_signs(signs: Float[Tensor, "J"], votes: list[Float[Tensor, "_"]]) -> Float[Tensor, "J"]:
    """The signs, or the network's own where it is clear about a track, and in general.

    Args:
        signs: agreed on by profiles, contradicted kinds reversed.
        votes: of each track, +1 where the network's own heading of a scan is that of the track's
            frame, else -1. In general clear: at most 8 % of the scans say otherwise than most of
            their track; clear about a track: at most a quarter.
    """
    mean = torch.stack([vote.mean() for vote in votes])
    scans = torch.tensor([float(len(vote)) for vote in votes])
    contradicting = float((scans * (1 - mean.abs()) / 2).sum() / scans.sum())
    if contradicting > _SETTLED:
        return signs
    return torch.where(mean.abs() >= _CLEAR, mean.sign().to(signs.dtype), signs)


def end_on(
    vote: Float[Tensor, "V"], sensors: Float[Tensor, "V 3"], sign: Float[Tensor, ""]
) -> EndOn:
    """The counts of one track, J = 1.

    Args:
        vote: +1 where the network's own heading of a scan is that of `sensors`' frame, else -1.
        sensors: from where each scan was taken, in the object's frame before `sign`.
        sign: -1 if the track is to be turned.
    """
    along = sign * sensors[:, 0] / sensors[:, :2].norm(dim=1).clamp_min(1e-6)
    seen = torch.stack((along > _END_ON, along < -_END_ON), dim=1)
    opposed = seen & (vote * sign < 0)[:, None]
    return EndOn(opposed.sum(0, keepdim=True).float(), seen.sum(0, keepdim=True).float())


def uncontradicted_signs(
    profiles: Profiles, signs: Float[Tensor, "J"], found: EndOn
) -> Float[Tensor, "J"]:
    """The signs, those of contradicted kinds reversed.

    Args:
        profiles: of the tracks, before `signs`.
        signs: agreed on by profiles.
        found: counts after `signs`.
    """
    turned = reversed_where(profiles, signs < 0)
    near = difference(turned, turned).topk(min(_NEIGHBOURS, len(signs)), largest=False).indices
    opposed, seen = found.opposed[near].sum(1), found.all[near].sum(1)
    share = torch.where(seen >= _FEWEST, opposed / seen.clamp_min(1), 0.0).amax(1)
    usual = found.opposed.sum() / found.all.sum().clamp_min(1)
    contradicted = share > torch.clamp(_TIMES * usual, min=_SHARE)
    kind = contradicted[near].float().mean(1) > _HALF
    return torch.where(kind, -signs, signs)
