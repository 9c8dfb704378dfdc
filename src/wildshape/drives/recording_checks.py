# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a recording lacks for results that can be believed, a sentence each."""

import filecmp
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from wildshape.drives.config import LinkConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.trajectory import FIRST_SCANS
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.progress import counted
from wildshape.records import Turn

_INSTANT_S = 0.005  # a turn of the fastest sensors lasts ten times as long
_SLOW_S = 0.21  # 5 Hz is well enough
_FEWEST_SCANS = 5
_FEWEST_TURNED = 3  # vehicles; of 134 that moved on streets and real drives 3 were, one a drive
_LEAST_WAY_M, _LEAST_STEP_M = 5.0, 0.05  # less tells no direction: odometry's noise is 15 mm
_STEEPEST_DEG = 30.0  # against the first scan; the steepest streets have 19, real drives 1
_LEAST_BYTES = 2000  # of a file; smaller ones hold hardly any points, and may be alike


def copies_of(files: Sequence[Path]) -> list[int]:
    """The frames that are exact copies of the ones before; `files`: one a frame.

    Those of one size are read as far as they are alike.
    """
    return [
        frame
        for frame, (before, after) in enumerate(pairwise(files), 1)
        if after.stat().st_size > _LEAST_BYTES and filecmp.cmp(before, after, shallow=False)
    ]


def copies_told(copies: Sequence[int]) -> list[str]:
    """A sentence if frames are copies of the ones before, as of a sensor that hangs."""
    if not copies:
        return []
    return [
        f"{counted(len(copies), 'scan')} equal to the one before, to the last bit; the first:"
        f" frame {copies[0]}"
    ]


def count_told(scans: int) -> list[str]:
    """A sentence if scans are too few to tell; `scans`: those with points."""
    if scans >= _FEWEST_SCANS:
        return []
    return [f"{counted(scans, 'scan')} with points: too few to tell which vehicles move"]


def backwards_told(turned: Sequence[bool]) -> list[str]:
    """A sentence if most moving vehicles drive with what the model takes for their rear ahead.

    `turned`: whether each one does.
    """
    backwards = sum(turned)
    if backwards < _FEWEST_TURNED or backwards <= len(turned) / 2:
        return []
    return [
        f"{backwards} of {len(turned)} moving vehicles drive backwards by their shapes: the scans"
        " are in reverse order of time, the sensor's way is wrong, or the model takes rears for"
        " fronts"
    ]


def sideways_told(drive: Drive, T_world_sensor: SE3) -> list[str]:
    """A sentence if the sensor does not go where its x looks, to 45 degrees.

    Where points have no times, they are taken for seen in a turn whose middle looks along x.
    Recordings with poses of their own have axes of their own, too.
    """
    if drive.T_world_sensor is not None:
        return []
    R, places = T_world_sensor.rotation.numpy(), T_world_sensor.translation.numpy()
    steps = np.diff(places, axis=0)
    steps[np.linalg.norm(steps, axis=1) < _LEAST_STEP_M] = 0.0
    ahead, left, _ = np.einsum("kji,kj->i", R[:-1], steps)
    if np.hypot(ahead, left) < _LEAST_WAY_M or ahead > abs(left) or has_times(drive):
        return []  # scans are read last: hardly any drive comes so far
    to = "backwards" if -ahead > abs(left) else "to its left" if left > 0 else "to its right"
    return [
        f"the sensor goes {to}: points without times need x forward and scans in order of time,"
        " else vehicles are misplaced and things that stand may seem to move"
    ]


def tipped_told(T_world_sensor: SE3, up: Sequence[float]) -> list[str]:
    """A sentence if the sensor tips on its way as no vehicle does.

    `up`: the vertical in the sensor frame, unit length.
    """
    upright = T_world_sensor.rotation.numpy() @ np.asarray(up)
    tipped = float(np.rad2deg(np.arccos(np.clip(upright @ upright[0], -1.0, 1.0))).max())
    if tipped < _STEEPEST_DEG:
        return []
    return [
        f"the sensor tips by {tipped:.0f} degrees, more than on any road: its way is wrong, and"
        " with it boxes and speeds; give whole scans, or a poses.txt"
    ]


def has_times(drive: Drive) -> bool:
    """Whether points of the first scans have times; one scan alone may be empty."""
    first = range(min(FIRST_SCANS, len(drive)))
    return any(drive.turn(frame).seconds is not None for frame in first)


def rate_told(scan_s: float | None, step_m: float, config: LinkConfig) -> list[str]:
    """A sentence where scans are so far apart in time that fast vehicles are lost.

    Args:
        scan_s: from a scan to the next, seconds, if known.
        step_m: that the sensor goes meanwhile.
        config: how vehicles are followed.
    """
    if scan_s is None or scan_s < _SLOW_S:
        return []
    fastest = config.wider(scan_s, step_m) * config.first_gate_m / scan_s
    return [
        f"at {1 / scan_s:.2g} scans a second fast vehicles are often lost, those above"
        f" {fastest:.0f} m/s always"
    ]


def clock_told(drive: Drive) -> list[str]:
    """A sentence if points have times that are of no use in any of the first scans."""
    first = ((frame, _read(drive, frame)) for frame in range(min(FIRST_SCANS, len(drive))))
    turns = {frame: turn for frame, turn in first if turn is not None}
    step = drive.scan_s
    unused = (t.met is not None and drive.turn(i).met is None for i, t in turns.items())
    if step is not None and any(unused):
        return [
            "the times at which points were met cannot be used: a turn would last much longer than"
            f" it is from a scan to the next, {step:.2g} s; scans of what drives are not corrected"
            " for its motion"
        ]
    timed = [frame for frame, turn in turns.items() if turn.seconds is not None]
    used = [seconds for frame in timed if (seconds := drive.turn(frame).seconds) is not None]
    spans = [float(np.ptp(seconds)) for seconds in used if len(seconds)]
    if spans and max(spans) < _INSTANT_S:
        return [
            f"times of a scan's points lie within {1000 * max(spans):.2g} ms, as of a sensor whose"
            " clock stands still: if it turns, scans are not corrected for its motion"
        ]
    if not timed or used:
        return []
    if drive.times is None:
        return [
            "points have times, but scans have none: without a times.txt they are not corrected for"
            " the sensor's motion"
        ]
    return [
        "times of points cannot be used: a turn would last much longer than it is from a scan to"
        f" the next, {drive.scan_s:.2g} s; scans are not corrected for the sensor's motion"
    ]


def _read(drive: Drive, frame: int) -> Turn | None:
    try:
        return drive.read(frame)
    except BadInputError:
        return None
