# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track made ready for evaluation: usable scans, turned, and the truth kept apart from them."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.datasets.tracks.truth import shape_mirrored, shape_partial, whole_shape
from wildshape.evaluation.metrics import hull_area, labelled_box, true_box
from wildshape.evaluation.results import Limits, Rotate, Skipped
from wildshape.geometry.box import FittedBox
from wildshape.geometry.transforms.rotation import random_rotation, random_yaw
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points, Sensor, SightLines, Track


@dataclass(frozen=True)
class Truth:
    """What a track's object really looks like, in its own frame; metres.

    Attributes:
        kind: `shape` (known), or `mirrored` (accumulated and reflected).
        shape: `(g, 3)`.
        partial: `(g, 3)` as accumulated; None where it is not at hand.
        area: of the surface, square metres, roughly (convex hull).
        box: as labelled, else tight around the shape.
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
        T_sensor_object: true poses of the scans as turned, if known.
        rays: of each scan those that passed the object by, if any are known.
        skipped: scans left out.
    """

    name: str
    scans: tuple[Points, ...]
    scan_names: tuple[str, ...]
    sensor: Sensor
    T_sensor_object: SE3 | None
    truth: Truth | None
    skipped: tuple[Skipped, ...]
    rays: tuple[SightLines | None, ...] = ()

    @property
    def middle(self) -> int:
        """Index of the middle scan."""
        return len(self.scans) // 2

    def inputs(self) -> list[Points]:
        """Fresh copies of the scans: a method may do with them what it likes."""
        return [scan.copy() for scan in self.scans]

    def part(self, which: Sequence[int]) -> "Case":
        """Some scans alone, with their poses and rays."""
        poses = self.T_sensor_object
        return replace(
            self,
            scans=tuple(self.scans[i] for i in which),
            scan_names=tuple(self.scan_names[i] for i in which),
            T_sensor_object=None if poses is None else poses[torch.tensor(which)],
            rays=tuple(self.rays[i] for i in which) if self.rays else (),
        )


def prepare(track: Track, rotate: Rotate, seed: int, limits: Limits) -> Case:
    """The case of a track under an input protocol; see `turn_track`."""
    usable, skipped = _usable(track, limits.min_points)
    truth = _truth(usable, limits.truth_points)
    turned = turn_track(_subsample(usable, limits.max_scans), rotate, seed)
    return Case(
        name=track.name,
        scans=turned.scans,
        scan_names=turned.scan_names,
        sensor=turned.sensor,
        T_sensor_object=turned.T_sensor_object,
        truth=truth,
        skipped=skipped,
        rays=turned.rays,
    )


def _usable(track: Track, min_points: int) -> tuple[Track, tuple[Skipped, ...]]:
    finite = [scan[np.isfinite(scan).all(axis=1)] for scan in track.scans]
    reasons = [_unusable(scan, min_points) for scan in finite]
    kept = [i for i, reason in enumerate(reasons) if not reason]
    cleaned = replace(track, scans=tuple(finite))
    named = zip(track.scan_names, reasons, strict=True)
    skipped = tuple(Skipped(track.name, scan, reason) for scan, reason in named if reason)
    return cleaned.part(kept), skipped


def _unusable(scan: Points, min_points: int) -> str:
    if len(scan) < min_points:
        return f"fewer than {min_points} finite points"
    return "all points equal" if bool((scan == scan[0]).all()) else ""


def _subsample(track: Track, max_scans: int | None) -> Track:
    count = len(track.scans)
    if max_scans is None or count <= max_scans:
        return track
    return track.part(np.linspace(0, count - 1, max_scans).round().astype(int).tolist())


def _truth(track: Track, count: int) -> Truth | None:
    if track.T_sensor_object is None or not track.scans:
        return None
    whole, partial = whole_shape(track), None
    if whole is None:
        whole, partial = shape_mirrored(track), shape_partial(track)
    elif track.shape_kind == "partial":
        partial = track.shape
    if not len(whole):
        return None
    known = track.shape is not None and track.shape_kind == "whole"
    shape, box = _thin(whole, count), _true_box(track, whole)
    partial = None if partial is None else _thin(partial, count)
    return Truth("shape" if known else "mirrored", shape, partial, hull_area(shape), box)


def _true_box(track: Track, shape: Points) -> FittedBox:
    """As labelled, if it is, else around the true shape."""
    if track.label_size_m is not None:
        return labelled_box(track.label_size_m)
    return true_box(shape, body=track.sensor.kind == "lidar")


def _thin(points: Points, count: int) -> Points:
    """At most so many, drawn once and for all."""
    if len(points) <= count:
        return points
    draw = np.random.default_rng(0).permutation(len(points))[:count]
    return points[np.sort(draw)]


def turn_track(track: Track, rotate: Rotate, seed: int) -> Track:
    """Each scan turned about its sensor's origin, its true pose along with it.

    The rotations depend on `seed` and the track's name alone, not on the order of the tracks.

    Args:
        track: as recorded.
        rotate: `none`, `yaw` (about the sensor's vertical: z of a LiDAR, y of a camera) or `so3`
            (uniform over all rotations).
        seed: of the draw.
    """
    if rotate == "none":
        return track
    generator = torch.Generator().manual_seed(zlib.crc32(f"{seed}/{track.name}".encode()))
    draw = _yaw(len(track.scans), track.sensor, generator)
    if rotate == "so3":
        draw = random_rotation(len(track.scans), generator)
    turn = SE3(draw.double(), torch.zeros(len(track.scans), 3, dtype=torch.float64))
    poses = track.T_sensor_object
    return replace(
        track,
        scans=tuple(turn[i].apply_numpy(scan) for i, scan in enumerate(track.scans)),
        T_sensor_object=None if poses is None else turn @ poses,
        rays=tuple(
            rays and rays.moved(turn[i].rotation.numpy(), np.zeros(3))
            for i, rays in enumerate(track.rays)
        ),
    )


def _yaw(count: int, sensor: Sensor, generator: torch.Generator) -> Float[Tensor, "count 3 3"]:
    about_z = random_yaw(count, generator)
    if sensor.kind == "lidar":
        return about_z
    # Relabelled axes (y, z, x): the same turn about y.
    order = torch.tensor([1, 2, 0])
    return about_z[:, order][:, :, order]
