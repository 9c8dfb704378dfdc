# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans posed as no neighbour is, put where their neighbours say they are (beyond the paper).

Behind a truck a LiDAR sees a flat wall: alone, such a scan is taken for a piece of the side as
often as not. Votes on half turns do not see that, and fitting scans onto each other cannot turn one
by a quarter. But an object does not turn by one from scan to scan. Where most neighbours are posed
alike, one that is not is an outlier, and so is a run of scans that is less sure than the others.
Turned back, it stands where what was seen of it begins.

Where the sensor's own motion is known, what an object turns is told apart from what the sensor
does, and no vehicle turns by a quarter within two seconds.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from wildshape.geometry.transforms.rotation import rotation_angle, rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import PoseOutlierConfig, TrackConfig
from wildshape.inference.tracks.heading_vote import FEWEST, slow
from wildshape.records import Points

_DEFAULT = TrackConfig()
_REACH = 3  # scans apart of two neighbours that are compared
_STRAYS = 0.02


class SensorMotion(NamedTuple):
    """How the sensor turned along a track.

    Attributes:
        rotation: `R_world_sensor` of each scan.
        seconds: when each was taken.
    """

    rotation: Float[Tensor, "V 3 3"]
    seconds: Float[Tensor, "V"]


def without_outliers(
    T_sensor_object: SE3,
    scans: Sequence[Points],
    shape: Float[Tensor, "P 3"],
    sure: Float[Tensor, "V"],
    config: TrackConfig = _DEFAULT,
) -> SE3:
    """The poses of a track's scans, outliers replaced by what their neighbours say.

    Args:
        T_sensor_object: one a scan, in time order, headings agreed on; if most neighbours are not
            posed alike (`slow`), they are returned as they are, for nothing is known then.
        scans: of one object, sensor frames.
        shape: points of the object, its frame.
        sure: how sure each scan is of its own pose, 0 to 1.
        config: what is alike, what is slow.
    """
    rotation = T_sensor_object.rotation
    alone = outliers(rotation, config.outliers)
    off = alone | _unsure_runs(rotation, alone, sure, config.outliers)
    off &= sure <= sure[~off].mean()
    if not bool(off.any()):
        return T_sensor_object
    unsure = bool((sure[off] < config.outliers.less_sure * sure[~off].mean()).all())
    if not slow(rotation[~off], config.vote, fewest=2 if unsure else FEWEST):
        return T_sensor_object
    return _put_back(off, T_sensor_object, rotation, scans, shape, config.outliers)


def without_leaps(
    T_sensor_object: SE3,
    scans: Sequence[Points],
    shape: Float[Tensor, "P 3"],
    sure: Float[Tensor, "V"],
    motion: SensorMotion,
    config: PoseOutlierConfig = _DEFAULT.outliers,
) -> SE3:
    """`without_outliers` where the sensor's motion is known: nothing turns faster than vehicles.

    Of all scans those are right that together are surest and do not contradict each other so.
    """
    rotation = motion.rotation @ T_sensor_object.rotation
    turn = torch.rad2deg(rotation_angle(rotation[:, None].mT @ rotation))
    since = (motion.seconds[:, None] - motion.seconds).abs()
    follows = turn < config.apart_deg * (since / config.leap_s).clamp_min(1.0)
    follows |= (since > config.unseen_s) & torch.ones_like(follows).tril(1).triu(1)
    right = _surest_chain(follows, sure)
    return _put_back(~right, T_sensor_object, rotation, scans, shape, config)


def _surest_chain(follows: Bool[Tensor, "V V"], sure: Float[Tensor, "V"]) -> Bool[Tensor, "V"]:
    """The scans that together are surest, each of which may follow the one before it."""
    total, before = sure.clone(), [-1] * len(sure)
    for i in range(1, len(sure)):
        reached = torch.where(follows[:i, i], total[:i], 0.0)
        if bool(reached.any()):
            before[i] = int(reached.argmax())
            total[i] += reached[before[i]]
    chain, i = torch.zeros_like(follows[0]), int(total.argmax())
    while i >= 0:
        chain[i] = True
        i = before[i]
    return chain


def _put_back(
    off: Bool[Tensor, "V"],
    T_sensor_object: SE3,
    rotation: Float[Tensor, "V 3 3"],
    scans: Sequence[Points],
    shape: Float[Tensor, "P 3"],
    config: PoseOutlierConfig,
) -> SE3:
    """The poses, those that are off turned as the scans beside them are; `rotation`: compared."""
    R_world_sensor = rotation @ T_sensor_object.rotation.mT
    rotation = rotation.clone()
    found = SE3(T_sensor_object.rotation.clone(), T_sensor_object.translation.clone())
    ends = _ends(shape)
    rows, right = torch.nonzero(off)[:, 0], torch.nonzero(~off)[:, 0]
    known = set(right.tolist())
    away = (rows[:, None] - right).abs().amin(1)
    for i in rows[away.argsort(stable=True)].tolist():
        near = i - 1 if i - 1 in known else i + 1
        rotation[i] = _turned_back(rotation[i], rotation[near], config)
        turned = R_world_sensor[i].mT @ rotation[i]
        found.translation[i] = _placed(scans[i], turned, ends, found.translation[near])
        found.rotation[i] = turned
        known.add(i)
    return found


def _placed(
    scan: Points,
    rotation: Float[Tensor, "3 3"],
    ends: Float[Tensor, "2 3"],
    near: Float[Tensor, "3"],
) -> Float[Tensor, "3"]:
    """Where an object so turned is: what the scan saw begins where the object faces the sensor.

    Args:
        scan: sensor frame.
        rotation: `R_sensor_object`.
        ends: least and largest coordinates of the object, its frame.
        near: where it is in a scan nearby, sensor frame; as high it is here.
    """
    seen = torch.from_numpy(scan).to(rotation) @ rotation
    low, high = _ends(seen)
    place = ((low + high) - ends.sum(0)) / 2
    place = torch.where(low > 0, low - ends[0], torch.where(high < 0, high - ends[1], place))
    place[2] = (near @ rotation)[2]
    return rotation @ place


def _ends(points: Float[Tensor, "n 3"]) -> Float[Tensor, "2 3"]:
    """Where points begin and end along each axis, but for strays."""
    return torch.quantile(points, points.new_tensor((_STRAYS, 1 - _STRAYS)), dim=0)


def _turned_back(
    own: Float[Tensor, "3 3"], near: Float[Tensor, "3 3"], config: PoseOutlierConfig
) -> Float[Tensor, "3 3"]:
    """A pose turned by quarters until it is like the neighbour's; that one if none is.

    A flat wall shows which way it faces, and not of which side it is.
    """
    turned = own @ rotation_z(torch.arange(4, dtype=own.dtype) * (math.pi / 2))
    best = min(turned, key=lambda one: _degrees(one, near))
    return best if _degrees(best, near) < config.apart_deg else near


def _unsure_runs(
    rotation: Float[Tensor, "V 3 3"],
    off: Bool[Tensor, "V"],
    sure: Float[Tensor, "V"],
    config: PoseOutlierConfig,
) -> Bool[Tensor, "V"]:
    """Of runs of scans, each posed like the next, those against a much surer one."""
    runs: list[list[int]] = []
    for i in torch.nonzero(~off)[:, 0].tolist():
        if runs and _degrees(rotation[runs[-1][-1]], rotation[i]) < config.apart_deg:
            runs[-1].append(i)
        else:
            runs.append([i])
    found = torch.zeros_like(off)
    best = max(runs, key=lambda run: float(sure[run].sum()))
    enough = config.less_sure * float(sure[best].mean())
    for way in (1, -1):
        last = best[-1] if way > 0 else best[0]
        for run in runs[runs.index(best) :: way][1:]:
            first, end = (run[0], run[-1])[::way]
            against = _degrees(rotation[last], rotation[first]) >= config.apart_deg
            if against and float(sure[run].mean()) < enough:
                found[run] = True
            else:
                last = end
    return found


def _degrees(one: Float[Tensor, "3 3"], other: Float[Tensor, "3 3"]) -> float:
    return math.degrees(float(rotation_angle(one.mT @ other)))


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
        angle[: count - on, on] = torch.rad2deg(rotation_angle(relative))
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
