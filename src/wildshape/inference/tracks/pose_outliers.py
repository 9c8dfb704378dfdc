# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans whose pose no neighbour shares, put where their neighbours are (beyond the paper).

Right in front of a truck's rear a LiDAR sees a flat wall and nothing of its edges: alone, such a
scan is taken for a piece of the side as often as not. Votes on half turns do not see that, and
fitting scans onto each other cannot turn one by a quarter. But where most neighbours are posed
alike, one that is not is an outlier: it stands between them, on the way from one to the other.
"""

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import PoseOutlierConfig, TrackConfig
from wildshape.inference.tracks.heading_vote import slow

_DEFAULT = TrackConfig()
_REACH = 3  # scans apart of two neighbours that are compared


def without_outliers(T_sensor_object: SE3, config: TrackConfig = _DEFAULT) -> SE3:
    """The poses of a track's scans, outliers replaced by what lies between their neighbours.

    Args:
        T_sensor_object: one a scan, in time order, headings agreed on; if most neighbours are not
            posed alike (`slow`), they are returned as they are, for nothing is known then.
        config: what is alike, what is slow.
    """
    off = outliers(T_sensor_object.rotation, config.outliers)
    if not bool(off.any()) or not slow(T_sensor_object.rotation[~off], config.vote):
        return T_sensor_object
    rotation = T_sensor_object.rotation.clone()
    place = T_sensor_object.inverse().translation.clone()
    right = torch.nonzero(~off)[:, 0]
    for i in torch.nonzero(off)[:, 0].tolist():
        before, after = right[right < i], right[right > i]
        # Two that are right: on either side, or the nearest two on the one side there is.
        a, b = (before[-1], after[0]) if len(before) and len(after) else _ends(before, after)
        share = (i - float(a)) / float(b - a)
        rotation[i] = rotation[a if abs(i - int(a)) <= abs(i - int(b)) else b]
        place[i] = place[a] + share * (place[b] - place[a])
    translation = -(rotation @ place[..., None])[..., 0]
    kept = off[:, None]
    return SE3(rotation, torch.where(kept, translation, T_sensor_object.translation))


def _ends(before: Tensor, after: Tensor) -> tuple[Tensor, Tensor]:
    """The two nearest of the side that has any: the way goes on as it went."""
    return (before[-1], before[-2]) if len(before) else (after[0], after[1])


def outliers(
    rotation: Float[Tensor, "V 3 3"], config: PoseOutlierConfig = _DEFAULT.outliers
) -> Bool[Tensor, "V"]:
    """Which scans of a track are turned by more than 45 degrees against neighbours that agree.

    Where two neighbours, on either side or, at an end of the track, the next two, agree within 25
    degrees, whatever turned from one to the other was not elsewhere between them. At least half of
    the scans stay.
    """
    count = len(rotation)
    angle = _to_next(rotation).tolist()
    off = torch.tensor([_contradicted(i, angle, config) for i in range(count)])
    return off if 2 * int(off.sum()) < count else torch.zeros_like(off)


def _to_next(rotation: Float[Tensor, "V 3 3"]) -> Float[Tensor, "V 4"]:
    """The angle in degrees between each scan and itself, the next, the one after that, and on."""
    count = len(rotation)
    angle = rotation.new_full((count, _REACH + 1), torch.nan)
    for on in range(min(_REACH + 1, count)):
        relative = rotation[: count - on].mT @ rotation[on:]
        cosine = (relative.diagonal(dim1=-2, dim2=-1).sum(-1) - 1) / 2
        angle[: count - on, on] = torch.rad2deg(torch.acos(cosine.clamp(-1, 1)))
    return angle


def _contradicted(i: int, to_next: list[list[float]], config: PoseOutlierConfig) -> bool:
    """Whether more pairs of neighbours that agree are against scan `i` than for it."""
    last = len(to_next) - 1

    def angle(j: int, k: int) -> float:
        return to_next[min(j, k)][abs(j - k)]

    pairs = [(i - back, i + on) for back, on in ((1, 1), (1, 2), (2, 1))]
    pairs += [(1, 2)] if i == 0 else [(last - 1, last - 2)] if i == last else []
    within = [(j, k) for j, k in pairs if min(j, k) >= 0 and max(j, k) <= last]
    agree = [(angle(i, j), angle(i, k)) for j, k in within if angle(j, k) < config.alike_deg]
    against = sum(min(pair) > config.apart_deg for pair in agree)
    return against > sum(max(pair) < config.alike_deg for pair in agree)
