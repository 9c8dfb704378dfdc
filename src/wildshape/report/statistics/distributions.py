# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Running distributions over tracks: how many points, how far, seen from where, how large."""

import numpy as np
import torch
from jaxtyping import Float, Int

from wildshape.datasets.tracks.truth import fuse_by_truth
from wildshape.geometry.box import fit_box
from wildshape.records import Points, SensorKind, Track
from wildshape.report.statistics.histogram import ANGLES, LENGTHS, Tally

_FEWEST_POINTS = 16


class RunningDistribution:
    """Running distributions over tracks.

    Attributes:
        points: a scan.
        scans: a track.
        seen: of posed scans, by truth: range, azimuth, elevation, turn (see `views`).
        sensed: of scans as they are: range, azimuth, elevation.
        extents: length, width, height by what they were taken from: shape, fused, scan.
    """

    def __init__(self) -> None:
        self.points, self.scans = Tally(LENGTHS), Tally(LENGTHS)
        self.seen = (Tally(LENGTHS), Tally(ANGLES, circular=True), Tally(ANGLES), Tally(ANGLES))
        self.sensed = (Tally(LENGTHS), Tally(ANGLES, circular=True), Tally(ANGLES))
        self.extents = {
            kind: tuple(Tally(LENGTHS) for _ in range(3)) for kind in ("shape", "fused", "scan")
        }

    def views(
        self,
        R_sensor_object: Float[np.ndarray, "s 3 3"],
        t_sensor_object: Float[np.ndarray, "s 3"],
        sizes: Int[np.ndarray, "tracks"],
    ) -> None:
        """Count posed scans: how far the object is, and from where, in ITS frame, it is seen.

        The scans of a track are next to each other, as many as `sizes` says; metres.
        """
        distance = np.linalg.norm(t_sensor_object, axis=1)
        towards = -np.einsum("sij,si->sj", R_sensor_object, t_sensor_object)
        towards /= np.maximum(distance, 1e-9)[:, None]
        starts = np.concatenate(([0], np.cumsum(sizes)[:-1]))
        middle = np.repeat(starts + sizes // 2, sizes)
        half = np.linalg.norm(towards - towards[middle], axis=1) / 2
        turn = np.degrees(2 * np.arcsin(np.minimum(half, 1.0)))  # by the cosine 0 was 8.5e-07
        ranges, azimuth, elevation, turns = self.seen
        _add_direction((ranges, azimuth, elevation), towards, distance)
        turns.add(np.maximum.reduceat(turn, starts))

    def scan_middles(self, track: Track) -> None:
        """Count where scans lie as seen by their sensor, for tracks whose poses nobody knows."""
        middles = np.stack([np.median(scan, axis=0) for scan in track.scans if len(scan)])
        ahead = _forward_left_up(middles.astype(np.float64), track.sensor.kind)
        distance = np.linalg.norm(ahead, axis=1)
        _add_direction(self.sensed, ahead / np.maximum(distance, 1e-9)[:, None], distance)

    def size(self, track: Track) -> None:
        """Count how long, wide and high the object is, by the best that is known of it."""
        if track.shape is not None and len(track.shape):
            kind = "shape" if track.shape_kind == "whole" else "fused"
            lengths = np.ptp(track.shape, axis=0)
        elif track.T_sensor_object is not None:
            kind, lengths = "fused", np.ptp(fuse_by_truth(track), axis=0)
        else:
            kind, lengths = "scan", _extent_of_scans(track)
        for tally, length in zip(self.extents[kind], lengths):
            tally.add(np.asarray([length]))


def _add_direction(
    tallies: tuple[Tally, Tally, Tally],
    direction: Float[np.ndarray, "s 3"],
    distance: Float[np.ndarray, "s"],
) -> None:
    ranges, azimuth, elevation = tallies
    ranges.add(distance)
    azimuth.add(np.degrees(np.arctan2(direction[:, 1], direction[:, 0])))
    elevation.add(np.degrees(np.arcsin(np.clip(direction[:, 2], -1.0, 1.0))))


def _forward_left_up(
    points: Float[np.ndarray, "n 3"], kind: SensorKind
) -> Float[np.ndarray, "n 3"]:
    """A LiDAR's frame as it is; a camera's (x right, y down, z forward) turned to such a one."""
    if kind == "lidar":
        return points
    return np.stack((points[:, 2], -points[:, 0], -points[:, 1]), axis=1)


def _extent_of_scans(track: Track) -> Float[np.ndarray, "3"]:
    """Length, width, height of the box, upright for the sensor, around the longest scan, metres."""
    boxes = [_upright_size(scan, track.sensor.kind) for scan in track.scans if len(scan)]
    return max(boxes, key=lambda size: float(size[0]))


def _upright_size(scan: Points, kind: SensorKind) -> Float[np.ndarray, "3"]:
    points = _forward_left_up(scan.astype(np.float64), kind)
    if len(points) < _FEWEST_POINTS:
        return np.sort(np.ptp(points, axis=0))[::-1].copy()
    return fit_box(torch.from_numpy(points)).size.numpy()
