# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track made ready for evaluation: usable scans, turned, and the truth kept apart from them."""

from dataclasses import dataclass, replace

import numpy as np

from wildshape.datasets.tracks.accumulation import shape_mirrored, shape_partial
from wildshape.evaluation.boxes import true_box
from wildshape.evaluation.metrics import hull_area
from wildshape.evaluation.skipped import Skipped
from wildshape.evaluation.turning import Rotate, turn_track
from wildshape.geometry.box import FittedBox
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, Track

MIN_POINTS = 16
MAX_TRUTH_POINTS = 8192


@dataclass(frozen=True)
class Truth:
    """What a track's object really looks like, in its own frame; metres.

    Attributes:
        kind: `shape` (known), or `mirrored` (accumulated and reflected).
        shape: `(g, 3)`.
        partial: `(g, 3)` as accumulated; None where the shape is known.
        area: of the surface, square metres, roughly (convex hull).
        box: tight around the shape.
    """

    kind: str
    shape: Points
    partial: Points | None
    area: float
    box: FittedBox


@dataclass(frozen=True)
class Case:
    """One track under one input protocol.

    Attributes:
        name: the track's.
        scans: what a method may see, with `sensor`.
        scan_names: one a scan.
        sensor: how they were taken.
        T_sensor_object: true poses of the scans as turned, if known.
        truth: if known.
        skipped: scans left out.
    """

    name: str
    scans: tuple[Points, ...]
    scan_names: tuple[str, ...]
    sensor: Sensor
    T_sensor_object: SE3 | None
    truth: Truth | None
    skipped: tuple[Skipped, ...]

    @property
    def middle(self) -> int:
        """Index of the middle scan."""
        return len(self.scans) // 2

    def inputs(self) -> list[Points]:
        """Fresh copies of the scans: a method may do with them what it likes."""
        return [scan.copy() for scan in self.scans]


def prepare(track: Track, rotate: Rotate, seed: int, max_scans: int | None = None) -> Case:
    """The case of a track.

    Truth is accumulated from all usable scans; only then the track is subsampled, evenly, to
    `max_scans`.
    """
    usable, skipped = _usable(track)
    truth = _truth(usable)
    turned = turn_track(_subsample(usable, max_scans), rotate, seed)
    return Case(
        name=track.name,
        scans=turned.scans,
        scan_names=turned.scan_names,
        sensor=turned.sensor,
        T_sensor_object=turned.T_sensor_object,
        truth=truth,
        skipped=skipped,
    )


def _usable(track: Track) -> tuple[Track, tuple[Skipped, ...]]:
    finite = [scan[np.isfinite(scan).all(axis=1)] for scan in track.scans]
    reasons = [_unusable(scan) for scan in finite]
    kept = [i for i, reason in enumerate(reasons) if not reason]
    cleaned = replace(track, scans=tuple(finite))
    named = zip(track.scan_names, reasons, strict=True)
    skipped = tuple(Skipped(track.name, scan, reason) for scan, reason in named if reason)
    return cleaned.part(kept), skipped


def _unusable(scan: Points) -> str:
    if len(scan) < MIN_POINTS:
        return f"fewer than {MIN_POINTS} finite points"
    return "all points equal" if bool((scan == scan[0]).all()) else ""


def _subsample(track: Track, max_scans: int | None) -> Track:
    count = len(track.scans)
    if max_scans is None or count <= max_scans:
        return track
    return track.part(np.linspace(0, count - 1, max_scans).round().astype(int).tolist())


def _truth(track: Track) -> Truth | None:
    if track.T_sensor_object is None or not track.scans:
        return None
    if track.shape is not None:
        shape = _thin(track.shape)
        return Truth("shape", shape, None, hull_area(shape), true_box(track.shape))
    whole = shape_mirrored(track)
    mirrored, partial = _thin(whole), _thin(shape_partial(track))
    return Truth("mirrored", mirrored, partial, hull_area(mirrored), true_box(whole))


def _thin(points: Points) -> Points:
    """At most `MAX_TRUTH_POINTS`, drawn once and for all."""
    if len(points) <= MAX_TRUTH_POINTS:
        return points
    draw = np.random.default_rng(0).permutation(len(points))[:MAX_TRUTH_POINTS]
    return points[np.sort(draw)]
