# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Truth for real tracks: scans accumulated by the labelled poses (METHOD 8).

For evaluation only. Training never needs it.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.geometry.box import extent
from wildshape.geometry.sampling import radius_inliers, statistical_inliers, voxel_thin
from wildshape.ops.nearest import nearest
from wildshape.records import Points, Track

_VOXEL_M, _SMALL_M = 0.04, 2.4
_OFF, _APART = 0.05, 4.0  # of the object's diagonal, and of the largest scan's
_BESIDE = 0.25  # share of the points
_LOOKED_AT = 4096  # points, whether they lie on a shape
_TIGHTER = 0.8  # of what the poses as given span; 285 simulated and real tracks: at least 1.0


def fine_voxel(points: Points) -> float:
    """Edge of the cubes that a true shape is thinned by, metres.

    0.04; less for what has a diagonal under 2.4 m: of an object of unit size, cubes for vehicles
    would leave a few hundred points, of a hand's breadth a dozen.
    """
    diagonal = extent(points) if len(points) else 0.0
    return _VOXEL_M * min(1.0, (diagonal or _SMALL_M) / _SMALL_M)


def fuse_by_truth(track: Track) -> Points:
    """All scans `(n, 3)` in the object frame, metres, as they are.

    Raises:
        BadInputError: the track has no poses.
    """
    if track.T_sensor_object is None:
        raise BadInputError(f"{track.name}: no poses, so its scans cannot be accumulated as truth.")
    T_object_sensor = track.T_sensor_object.inverse()
    moved = [T_object_sensor[i].apply_numpy(scan) for i, scan in enumerate(track.scans)]
    return np.concatenate(moved) if moved else np.zeros((0, 3), np.float32)


def shape_partial(track: Track) -> Points:
    """What the sensor saw of the object over the track: `(g, 3)` in the object frame, metres.

    Raises:
        BadInputError: the track has no poses.
    """
    return _thinned(_clean(track))


def shape_mirrored(track: Track) -> Points:
    """`shape_partial` with its reflection at the object's own x-z plane (y -> -y) added.

    Raises:
        BadInputError: the track has no poses.
    """
    return _thinned(_mirrored(_clean(track)))


def _thinned(points: Points) -> Points:
    return voxel_thin(points, fine_voxel(points))


def _mirrored(points: Points) -> Points:
    return np.concatenate((points, points * np.asarray((1, -1, 1), points.dtype)))


def _clean(track: Track) -> Points:
    points = fuse_by_truth(track)
    return points[statistical_inliers(points)]


def whole_shape(track: Track) -> Points | None:
    """The track's shape, with its reflection where it is `partial`: what errors are against."""
    if track.shape is None or track.shape_kind != "partial":
        return track.shape
    return _thinned(_mirrored(track.shape))


def misplaced(track: Track) -> str:
    """What is odd about where true poses put the scans, or nothing.

    Poses the wrong way round, shapes of another unit or frame and labels with length and width
    exchanged would make figures meaningless.

    Raises:
        BadInputError: the track has no poses.
    """
    finite = [scan[np.isfinite(scan).all(axis=1)] for scan in track.scans]
    track = replace(track, scans=tuple(finite))
    points = fuse_by_truth(track)
    if not len(points):
        return ""
    if _beside_label(track, points) > _BESIDE:
        return "by its true poses its scans lie beside its labelled box (label_size_m)"
    if track.shape is None or not len(track.shape):
        largest = max(extent(scan) for scan in finite if len(scan))
        apart = extent(points) > _APART * largest
        if apart or _spanned_if_inverted(track) < _TIGHTER * extent(points):
            return "its true poses do not bring its scans together"
        return ""
    some = points[:: -(-len(points) // _LOOKED_AT)]
    off = float(np.median(_distances(some, track.shape)))
    if off <= _OFF * min(extent(points), extent(track.shape)):
        return ""
    return f"by its true poses its scans lie {off:.3g} m off its true shape"


def _distances(points: Points, shape: Points) -> Float[np.ndarray, "n"]:
    """From each point to the nearest of a shape, metres; training looks, too, and has no scipy."""
    found = nearest(torch.as_tensor(points)[None].float(), torch.as_tensor(shape)[None].float())
    return found.distance_squared[0].sqrt().numpy()


def _spanned_if_inverted(track: Track) -> float:
    assert track.T_sensor_object is not None
    return extent(fuse_by_truth(replace(track, T_sensor_object=track.T_sensor_object.inverse())))


def _beside_label(track: Track, points: Points) -> float:
    """Share of the points, in the object frame, that are well outside of its labelled box."""
    if track.label_size_m is None:
        return 0.0
    beyond = np.abs(points) - np.asarray(track.label_size_m) / 2
    return float((beyond > _OFF * extent(points)).any(1).mean())


@dataclass(frozen=True)
class TruthBuilder:
    """Makes a track's `shape` from its scans and poses.

    Attributes:
        kind: `partial` is what the sensor saw of the object over the track; `mirrored` adds the
            reflection at the object's own x-z plane (y -> -y).
        outliers: which rule removes stray points; see `geometry.sampling`.
        radius: of the rule `radius`: a point needs `neighbours` others within this, metres.
        strip: height above the lowest points that is left out as ground, metres; for readers
            that have not already done so.
        lowest: share of the points that may lie under the ground from which `strip` counts: one
            stray point must not be what it is measured from.
    """

    kind: Literal["partial", "mirrored"] = "partial"
    outliers: Literal["statistical", "radius", "none"] = "statistical"
    radius: float = 0.15
    neighbours: int = 8
    strip: float = 0.0
    lowest: float = 0.005

    def with_shape(self, track: Track) -> Track | None:
        """The track with its shape.

        None where there is nothing to build it from: no poses, or no point that is left.
        """
        if track.T_sensor_object is None:
            return None
        points = self._clean(fuse_by_truth(track))
        if self.kind == "mirrored":
            points = _mirrored(points)
        if not len(points):
            return None
        return replace(track, shape=_thinned(points), shape_kind=self.kind)

    def _clean(self, points: Points) -> Points:
        if self.outliers == "statistical":
            points = points[statistical_inliers(points)]
        elif self.outliers == "radius":
            points = points[radius_inliers(points, self.radius, self.neighbours)]
        if self.strip <= 0 or not len(points):
            return points
        floor = np.quantile(points[:, 2], self.lowest) + self.strip
        return points[points[:, 2] >= floor]
