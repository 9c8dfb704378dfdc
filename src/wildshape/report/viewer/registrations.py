# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The ways to lay a track's scans over each other that the viewer compares."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.identity import Identity
from wildshape.baselines.pairs import Chained
from wildshape.evaluation.metrics import ACCURATE_DEG, RegistrationError, registration_error
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.registration import to_middle
from wildshape.records import Track
from wildshape.report.viewer.sources import CompletedScan

BEFORE, AFTER, ICP, TRUTH = "before: only centred", "after: Wildshape", "local ICP", "true poses"
WAYS = (AFTER, BEFORE, ICP, TRUTH)


@dataclass(frozen=True)
class Moves:
    """One way.

    Attributes:
        T_middle_scan: one a scan.
        error: one a scan; None without true poses.
        middle: number of the middle scan.
    """

    T_middle_scan: SE3
    error: RegistrationError | None
    middle: int

    @property
    def verdict(self) -> str:
        """How well it does by the truth, or nothing; the middle scan against itself is no test."""
        if self.error is None or len(self.T_middle_scan) < 2:
            return ""
        degrees = np.delete(self.error.rotation_deg.numpy(), self.middle)
        metres = np.median(np.delete(self.error.translation_m.numpy(), self.middle))
        right = 100 * np.mean(degrees <= ACCURATE_DEG)
        return f"{np.median(degrees):.1f}°, {metres:.2f} m median; {right:.0f} % within 30°"


def moves(way: str, track: Track, completed: Mapping[int, CompletedScan]) -> Moves | None:
    """A track's scans taken to its middle scan's frame; None where that cannot be done (yet)."""
    if not all(len(scan) for scan in track.scans):
        return None
    T_middle_scan = _moves(way, track, completed)
    if T_middle_scan is None:
        return None
    truth = track.T_sensor_object
    if truth is None:
        return Moves(T_middle_scan, None, track.middle)
    error = registration_error(T_middle_scan, truth, truth[track.middle])
    return Moves(T_middle_scan, error, track.middle)


def _moves(way: str, track: Track, completed: Mapping[int, CompletedScan]) -> SE3 | None:
    if way == BEFORE:
        return Identity().register_track(track.scans, track.sensor)
    if way == ICP:
        return Chained(LocalIcp()).register_track(track.scans, track.sensor)
    if way == TRUTH:
        return None if track.T_sensor_object is None else to_middle(track.T_sensor_object)
    poses = [completed[i].pose for i in range(len(track.scans)) if i in completed]
    known = [pose for pose in poses if pose is not None]
    return to_middle(stack(known)) if len(known) == len(track.scans) else None
