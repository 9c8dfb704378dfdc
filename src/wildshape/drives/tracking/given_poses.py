# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether poses that came with a drive fit its scans: inverse ones, or another frame's, do not.

Nor do those of an odometry that was held back.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
import torch

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import HALF_TICK, Drive
from wildshape.drives.tracking.ground import height_above_ground
from wildshape.drives.tracking.mounting import Mounting
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.ops.nearest import nearest
from wildshape.records import Points

_PAIRS, _LEAST_M, _MOST_M = 3, 2.0, 6.0
_STANDING_M, _NEAR_M, _REACH_M = 0.5, 3.0, 40.0
_MOST_POINTS, _FEWEST_POINTS = 1500, 100
_FITS_M = 0.3
_BETTER = 0.15
_CLEARLY = 0.35  # right poses fit so much better than none, however few rings the sensor has
_STANDS, _GOES = 0.5, 0.6  # less does not fit where the sensor stands by the poses, or goes
_BESIDE_M, _PEAK = 0.5, 0.05
_JUMP_M = 0.5  # a smaller change of step a scan may be the driver's
_FAR_M = (5.0, 12.0)  # scans so far apart tell a way that is a twentieth too long
_TIMES = (0.85, 0.9, 0.95, 1.05, 1.1, 1.15)
_TURNS_DEG = (-8.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0, 8.0)  # of what is turned more too little fits
_DRIFTS_DEG = (-0.4, -0.2, -0.1, 0.1, 0.2, 0.4)  # a scan
_CAP_M, _CLOSER_M = 0.5, 0.03

_WITHOUT = (
    "the poses do not fit the scans, which lie better on each other without them: give"
    " T_world_sensor in metres, not a camera's poses, and scans as the sensor saw them"
)
_STILL = (
    "by the poses the sensor hardly moves, but its scans do not lie on each other: give"
    " T_world_sensor in metres"
)
_WRONG = (
    "the poses do not fit the scans: a wrong scale, order or frame; give T_world_sensor in metres,"
    " a line a scan"
)
_HELD = (
    "odometry hardly moves the sensor, but the first scans do not lie on the last: the way found is"
    " wrong, and so are speeds; give a poses.txt"
)
_JUMP = "the poses jump at frame {}, where the scans do not: mend T_world_sensor"
_TIMES_WRONG = (
    "the poses fit the scans better with all ways {:g} times as long: give T_world_sensor in metres"
)
_AXES = (
    "the poses fit the scans better with their y and z reversed: give T_world_sensor in the axes of"
    " the scans, z up"
)
_TURNED = (
    "the poses fit the scans better turned by {:g} degrees about the sensor's z: give"
    " T_world_sensor, not the poses of another frame of the vehicle"
)
_DRIFTS = (
    "the poses fit the scans better turned by {} degrees more each scan: their heading drifts; mend"
    " T_world_sensor, or leave it out"
)
_LATE = (
    "the poses fit the scans better if each is taken for the scan {} it: give each scan the pose of"
    " its own time"
)
_INVERSE = (
    "the inverse of the poses fits the scans better: give T_world_sensor, not its inverse, in the"
    " order of the scans"
)


def misfit(drive: Drive, mounting: Mounting, config: DriveConfig) -> str:
    """What seems to be wrong with the poses of a drive; empty where nothing does.

    Scans a few metres apart are laid on each other by the poses, by none and by their inverse. On
    real and simulated streets 0.58 and more of what stands there fits by the right poses, with few
    rings little by none; half and less fits by those of half the scale or in another order. Amid
    traffic half of it moves, and 0.50 fits by right poses, but 0.08 more than half a metre beside
    them; by wrong ones as much and more fits there.

    Where the sensor hardly moves by the poses, its first scans are laid on its last: 0.93 fits
    where it stands, 0.46 and less where it went 3 m. Where the step changes most, a jump of 1.5 m
    leaves 0.27.

    Scans farther apart are also laid on each other by ways that are longer or shorter, in axes
    turned about z, with y and z reversed, as z may look down, and turned more each scan. On seven
    drives none of these came as close as the right poses; ways 5 % wrong were 3 cm worse than right
    ones at the least, reversed axes 7 cm, on six drives a turn of 2 degrees 10 cm.
    """
    T = drive.T_world_sensor
    if T is None:
        return ""
    shares = []
    pairs = list(_pairs(T, _MOST_M)) or list(_pairs(T, math.inf)) or _first_and_last(len(T))
    for start, end in pairs:
        given, none = T[end].inverse() @ T[start], SE3.identity()
        inverse = T[end] @ T[start].inverse()
        motions = (given, none, inverse, *_beside(given))
        shares += _shares(drive, mounting, config, (start, end), motions)
    if not shares:
        return ""
    given, none, inverse, *beside = np.median(shares, axis=0).tolist()
    if max(none, inverse) >= given + _BETTER:
        return _INVERSE if inverse > none else _WITHOUT
    if _reach_m(T) < _LEAST_M:
        return _STILL if given < _STANDS else ""
    least = min(_GOES, max(none, inverse) + _CLEARLY)
    if given < min(least, max(beside) + _PEAK):
        return _WRONG
    return _jump(drive, T, mounting, config) or _otherwise(drive, T, mounting, config)


def held_back(drive: Drive, T: SE3, mounting: Mounting, config: DriveConfig) -> str:
    """A sentence if a way found by odometry stays in one place, and the scans do not.

    Long plain walls do so to a slow sensor: their rings look alike wherever it stands.
    """
    if len(T) < 2 or _reach_m(T) >= _LEAST_M:
        return ""
    shares = []
    for start, end in _first_and_last(len(T)):
        motion = T[end].inverse() @ T[start]
        shares += _shares(drive, mounting, config, (start, end), (motion,))
    return _HELD if shares and np.median(shares) < _STANDS else ""


def _beside(T_target_source: SE3) -> list[SE3]:
    """The same motion ending half a metre ahead, behind, to the left and to the right."""
    shifts = torch.tensor(((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)), dtype=torch.float64)
    rotation, translation = T_target_source.rotation, T_target_source.translation
    return [SE3(rotation, translation + _BESIDE_M * shift) for shift in shifts]


def _otherwise(drive: Drive, T: SE3, mounting: Mounting, config: DriveConfig) -> str:
    """A sentence if the poses fit clearly better in another form, or those of scans beside."""
    told = [_AXES, *(_TURNED.format(abs(angle)) for angle in _TURNS_DEG)]
    told += [_TIMES_WRONG.format(times) for times in _TIMES]
    told += [_DRIFTS.format(abs(angle)) for angle in _DRIFTS_DEG]
    rows, gains = [], []
    for start, end in _far_pairs(T):
        source, target = (_standing(drive, at, mounting, config) for at in (start, end))
        if min(len(source), len(target)) >= _FEWEST_POINTS:
            given = T[end].inverse() @ T[start]
            motions = (given, *_others(given, drive.moments[end] - drive.moments[start]))
            rows.append([float(_away(source, target, one).mean()) for one in motions])
            beside = (_away(source, target, one).mean() for one in _scan_beside(T, start, end))
            gains.append([rows[-1][0] - float(away) for away in beside])
    if not rows:
        return ""
    given_m, *others_m = np.median(rows, axis=0).tolist()
    best = int(np.argmin(others_m))
    after, before = np.max(gains, axis=0).tolist()  # a steady way tells nothing
    closer = {
        told[best]: given_m - others_m[best],
        _LATE.format("after"): after,
        _LATE.format("before"): before,
    }
    likely = max(closer, key=lambda one: closer[one])
    return likely if closer[likely] > _CLOSER_M else ""


def _scan_beside(T_world_sensor: SE3, start: int, end: int) -> list[SE3]:
    """The motion one scan earlier, and one later; the same where there is none."""
    last = len(T_world_sensor) - 1
    steps = (-min(start, 1), min(last - end, 1))
    return [T_world_sensor[end + by].inverse() @ T_world_sensor[start + by] for by in steps]


def _others(T_target_source: SE3, ticks: int | float) -> list[SE3]:
    """The same motion in the other axes, at the other scales, and without each drift so long."""
    axes = torch.diag(torch.tensor((1.0, -1.0, -1.0), dtype=torch.float64))
    frames = [_turned(axes), *(_turned(rotation_z(turn)) for turn in _radians(_TURNS_DEG))]
    halves = [_turned(rotation_z(ticks / 2 * turn)) for turn in _radians(_DRIFTS_DEG)]
    return [
        *(frame @ T_target_source @ frame.inverse() for frame in frames),
        *(T_target_source.scaled(times) for times in _TIMES),
        *(half @ T_target_source @ half for half in halves),
    ]


def _radians(degrees: Sequence[float]) -> torch.Tensor:
    return torch.tensor(degrees, dtype=torch.float64).deg2rad()


def _turned(rotation: torch.Tensor) -> SE3:
    return SE3(rotation, torch.zeros(3, dtype=torch.float64))


def _jump(drive: Drive, T_world_sensor: SE3, mounting: Mounting, config: DriveConfig) -> str:
    """A sentence if the scans around the largest change of step do not fit by the poses.

    Scans too far apart may have little in common; `trajectory.jumps` tells of them.
    """
    places = T_world_sensor.translation.numpy()
    steps = np.diff(places, axis=0) / np.maximum(np.diff(drive.moments), HALF_TICK)[:, None]
    changes = np.linalg.norm(np.diff(steps, axis=0), axis=1)
    at = int(changes.argmax()) if len(changes) else 0
    if not len(changes) or changes[at] < _JUMP_M:
        return ""
    for end in (at + 1, at + 2):
        if np.linalg.norm(places[end] - places[end - 1]) > _MOST_M:
            continue
        motions = T_world_sensor[end].inverse() @ T_world_sensor[end - 1], SE3.identity()
        fits = _shares(drive, mounting, config, (end - 1, end), motions)
        if any(fit < min(_GOES, none + _BETTER) for fit, none in fits):
            return _JUMP.format(end)
    return ""


def _shares(
    drive: Drive,
    mounting: Mounting,
    config: DriveConfig,
    pair: tuple[int, int],
    motions: Sequence[SE3],
) -> list[list[float]]:
    """The share of one scan that lies on another by each motion; nothing of hardly any points."""
    source, target = (_standing(drive, at, mounting, config) for at in pair)
    if min(len(source), len(target)) < _FEWEST_POINTS:
        return []
    return [[_fitting(source, target, one) for one in motions]]


def _reach_m(T_world_sensor: SE3) -> float:
    """How far from its first place the sensor gets by the poses."""
    places = T_world_sensor.translation.numpy()
    return float(np.linalg.norm(places - places[0], axis=1).max())


def _first_and_last(frames: int) -> list[tuple[int, int]]:
    """Of the first and the last frames, each in one pair: the very last may be half a scan."""
    return [(start, frames - 1 - start) for start in range(min(_PAIRS, frames // 2))]


def _pairs(T_world_sensor: SE3, most_m: float) -> Iterator[tuple[int, int]]:
    """Frames between which the sensor moves some metres, by the poses or by their inverse."""
    places = [T.translation.numpy() for T in (T_world_sensor, T_world_sensor.inverse())]
    frames = len(places[0])
    for start in np.linspace(0, frames, _PAIRS, endpoint=False).astype(int).tolist():
        away = np.array([np.linalg.norm(at[start:] - at[start], axis=1) for at in places])
        some = np.flatnonzero(((away > _LEAST_M) & (away < most_m)).any(0))
        if len(some):
            yield start, start + int(some[0])


def _far_pairs(T_world_sensor: SE3) -> Iterator[tuple[int, int]]:
    """Frames as far apart as scans still tell the way between them."""
    places = T_world_sensor.translation.numpy()
    for start in np.linspace(0, len(places), _PAIRS, endpoint=False).astype(int).tolist():
        away = np.linalg.norm(places[start:] - places[start], axis=1)
        some = np.flatnonzero((away > _FAR_M[0]) & (away < _FAR_M[1]))
        if len(some):
            yield start, start + int(some[-1])


def _standing(drive: Drive, frame: int, mounting: Mounting, config: DriveConfig) -> Points:
    """What stands on the ground around the sensor; the ground's rings go with it."""
    points = drive.scan(frame)
    level = mounting.level(points)
    away = np.hypot(level[:, 0], level[:, 1])
    heights = height_above_ground(level, mounting.height_m, config.ground)
    return points[(heights > _STANDING_M) & (away > _NEAR_M) & (away < _REACH_M)]


def _fitting(source: Points, target: Points, T_target_source: SE3) -> float:
    """The share of a scan that lies on another."""
    return float((_away(source, target, T_target_source) < _FITS_M).float().mean())


def _away(source: Points, target: Points, T_target_source: SE3) -> torch.Tensor:
    """How far some points of a scan lie from another, metres, half a metre at most."""
    some = source[:: 1 + len(source) // _MOST_POINTS]
    clouds = (torch.from_numpy(one)[None] for one in (T_target_source.apply_numpy(some), target))
    return nearest(*clouds).distance_squared.sqrt().clamp_max(_CAP_M)
