# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scans of a track agree on which way is front (METHOD 11, 12). Label-free.

What fails in single scans of a near-symmetric object is the half turn. Where the scans of a track
follow each other, the object does not turn around between them; that is seen from poses that turn
slowly, half turns aside. However each scan was turned, a LiDAR that moves on is, seen from the
object, near the place where it was before, and would not be if one of two scans were turned around.
Of a camera's views, which may come in no order, each is laid on the next, as far as both saw the
same. The track's mean shape is asked, too, which knows front from back better than that of one
scan, and what a scan found for itself counts the more the surer it is.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.surface import mirrored
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import HeadingVoteConfig
from wildshape.ops.nearest import nearest

FEWEST = 4
"""Scans that tell whether they follow each other."""
_SMALLEST_M = 1e-9
_DEFAULT = HeadingVoteConfig()


def half_turn(middle_x: float, dtype: torch.dtype = torch.float64) -> SE3:
    """About the vertical through the middle of the object's length."""
    rotation = torch.diag(torch.tensor((-1.0, -1.0, 1.0), dtype=dtype))
    return SE3(rotation, torch.tensor((2 * middle_x, 0.0, 0.0), dtype=dtype))


def turned_where(T_sensor_object: SE3, sign: Float[Tensor, "V"], middle_x: float) -> SE3:
    """The poses, those of sign -1 turned by `half_turn`."""
    turned = T_sensor_object @ half_turn(middle_x, T_sensor_object.rotation.dtype)
    return turned.where(sign < 0, T_sensor_object)


def continuous_signs(
    rotation: Float[Tensor, "V 3 3"],
    own: Float[Tensor, "V"] | None = None,
    config: HeadingVoteConfig = _DEFAULT,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each pose: turn those of -1 by a half turn and few neighbours are opposed.

    A problem of signs (Z2 synchronisation) among neighbours in time, solved exactly: the best signs
    up to a scan are kept for each choice of the last ones (Viterbi's algorithm).

    Args:
        rotation: `R_sensor_object`, in time order.
        own: what speaks for each pose as it is, in neighbours posed alike; None: nothing, and which
            way all look is left open.
        config: which neighbours are compared.
    """
    count, reach = len(rotation), config.neighbours
    own_votes = np.zeros(count) if own is None else own.double().numpy()
    turns = rotation.double().reshape(count, 9).numpy()
    # A state holds the signs of the last `reach` scans, the latest in its lowest bit.
    states = 1.0 - 2.0 * (np.arange(1 << reach)[:, None] >> np.arange(reach) & 1)
    score = np.zeros(len(states))
    dropped = np.empty((count, len(states)), np.int64)
    for i in range(count):
        before = turns[max(i - reach, 0) : i][::-1]
        alike = (before @ turns[i] - 1) / 2  # cosine of the angle between both poses
        lean = own_votes[i] + states[:, : len(alike)] @ alike
        both = np.stack((score + lean, score - lean)).reshape(2, 2, -1)  # sign, oldest sign, rest
        dropped[i] = both.argmax(axis=1).T.ravel()
        score = both.max(axis=1).T.ravel()
    signs, state = rotation.new_ones(count), int(score.argmax())
    for i in reversed(range(count)):
        signs[i] = states[state, 0]
        state = state >> 1 | int(dropped[i, state]) << (reach - 1)
    return signs


def slow(
    rotation: Float[Tensor, "V 3 3"], config: HeadingVoteConfig = _DEFAULT, fewest: int = FEWEST
) -> bool:
    """Whether most neighbours are posed alike, half turns aside: the scans follow each other."""
    if len(rotation) < fewest:
        return False
    flipped = rotation * rotation.new_tensor((-1.0, -1.0, 1.0))
    trace = torch.maximum(
        _trace(rotation[:-1].mT @ rotation[1:]), _trace(rotation[:-1].mT @ flipped[1:])
    )
    angle = torch.rad2deg(torch.acos(((trace - 1) / 2).clamp(-1, 1)))
    return float(angle.quantile(0.75)) < config.slow_deg


def _trace(matrix: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch"]:
    return matrix.diagonal(dim1=-2, dim2=-1).sum(-1)


def followed_signs(
    rotation: Float[Tensor, "V 3 3"],
    weights: Float[Tensor, "V"],
    config: HeadingVoteConfig = _DEFAULT,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each scan of a `slow` track: turn those of -1, and most are posed one way.

    Args:
        rotation: `R_sensor_object`, as each scan found it.
        weights: how sure each scan is of its own pose, 0 to 1.
        config: which neighbours are compared.
    """
    return continuous_signs(rotation, _own_votes(weights, config), config)


def _own_votes(weights: Float[Tensor, "V"], config: HeadingVoteConfig) -> Float[Tensor, "V"]:
    """What each scan's own pose weighs, in neighbours posed alike."""
    return config.own_alike * -(1 - weights).log().clamp_min(-config.own_most)


def voted_signs(
    gain: Float[Tensor, "V"],
    links: Float[Tensor, "W"],
    weights: Float[Tensor, "V"],
    config: HeadingVoteConfig = _DEFAULT,
    *,
    leaps: bool = False,
) -> Float[Tensor, "V"]:
    """+1 or -1 for each scan of a track whose scans do not follow each other: turn those of -1.

    Args:
        gain: by how much the track's shape costs more in a scan when turned around, metres.
        links: what speaks for each scan looking as the next one does, metres; one fewer than scans
            (`nearness_of_next`, `likeness_of_next`).
        weights: how sure each scan is of its own pose, 0 to 1.
        config: weights of the vote.
        leaps: too few scans to tell that the sensor did not pass by between two: a sure one weighs
            as much as its neighbour.
    """
    own = config.own_m * (weights + config.unsure)
    own = config.near_m * _own_votes(weights, config) if leaps else own
    return _agreed(config.shape_votes * gain + own, links)


def _agreed(single: Float[Tensor, "V"], links: Float[Tensor, "W"]) -> Float[Tensor, "V"]:
    """Signs by what the shape says of each single scan, and each scan of the next one.

    The shape is one more member of the vote, and is never turned.
    """
    count = len(single)
    votes = single.new_zeros(count + 1, count + 1)
    row = torch.arange(count)
    votes[row, count] = single + 1e-9  # where no scan says anything, most stay
    votes[row[:-1], row[1:]] = links
    eigenvector = torch.linalg.eigh(votes + votes.T).eigenvectors[:, -1]
    signs = eigenvector[:-1] * eigenvector[-1]
    return torch.where(signs < 0, -torch.ones_like(signs), 1.0)


def nearness_of_next(
    sensors: Float[Tensor, "V 3"], middle_x: float, config: HeadingVoteConfig = _DEFAULT
) -> Float[Tensor, "W"]:
    """By how much farther from the next one each sensor would stand if one scan were turned around.

    Between 1 and -1 m, whatever the distances; little where the sensor moved, or usually moves, as
    far as it stood from the object, for nothing is known of the way between. Turns of the sensor
    change nothing: where it stood, seen from the object, is the same.

    Args:
        sensors: where each scan was taken, object frame, by the pose that it found for itself;
            one after the other in time.
        middle_x: of the object's length, object frame.
        config: `near_m`, `leap`.
    """
    place = sensors - sensors.new_tensor((middle_x, 0.0, 0.0))
    now, after = place[:-1], place[1:]
    there = after * after.new_tensor((-1.0, -1.0, 1.0))
    as_they_are, turned = (now - after).norm(dim=-1), (now - there).norm(dim=-1)
    away = (now.norm(dim=-1) + after.norm(dim=-1)) / 2
    least = torch.minimum(as_they_are, turned)
    moved = torch.maximum(least, least.median()) / away.clamp_min(_SMALLEST_M)
    clear = (turned - as_they_are) / (turned + as_they_are).clamp_min(_SMALLEST_M)
    return (config.near_m * clear * torch.exp(-(moved / config.leap).square())).double()


def likeness_of_next(
    clouds: Float[Tensor, "V n 3"],
    middle_x: float,
    *,
    mirror: bool,
    config: HeadingVoteConfig = _DEFAULT,
) -> Float[Tensor, "W"]:
    """By how much each scan lies worse on the next one when turned around, and the reverse.

    Scans that follow each other see nearly the same side of the object, so that they lie on each
    other if they are posed alike, and a bonnet on a boot if not. Where a sensor passed by between
    them they lie on each other in neither way, and say little.

    Args:
        clouds: the scans' points in the object frame, by the pose that each found for itself.
        middle_x: of the object's length, object frame.
        mirror: the object is symmetric in the plane y = 0.
        config: `far_m`, `same_side_m`.
    """
    turned = half_turn(middle_x, clouds.dtype).apply(clouds)
    bank = mirrored(clouds) if mirror else clouds
    there = _difference(turned[:-1], clouds[:-1], bank[1:], config)
    back = _difference(turned[1:], clouds[1:], bank[:-1], config)
    return (there + back).double()


def _difference(
    turned: Float[Tensor, "W n 3"],
    stands: Float[Tensor, "W n 3"],
    bank: Float[Tensor, "W m 3"],
    config: HeadingVoteConfig,
) -> Float[Tensor, "W"]:
    """The difference of two misfits, worth the more the better one of them is."""
    worse, better = (_misfit(points, bank, config.far_m) for points in (turned, stands))
    least = torch.minimum(worse, better)
    return (worse - better) * torch.exp(-(least / config.same_side_m).square())


def _misfit(
    points: Float[Tensor, "P n 3"], bank: Float[Tensor, "P m 3"], most_m: float
) -> Float[Tensor, "P"]:
    """Mean distance of points to their cloud, metres, each at most `most_m`."""
    return nearest(points, bank).distance_squared.sqrt().clamp_max(most_m).mean(-1)
