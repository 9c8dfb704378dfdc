# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Volume that two oriented boxes share, exactly, for any rotation.

The shared part is convex. Its corners are corners of one box inside the other, and points where an
edge of one passes through a face of the other; qhull takes the volume of their hull.
"""

import numpy as np
from jaxtyping import Float

from wildshape.geometry.box import EDGES, SIGNS, FittedBox

_INSIDE, _FLAT = 1e-9, 1e-12


def box_iou(a: FittedBox, b: FittedBox) -> float:
    """Intersection over union of two boxes in one frame, 0 to 1."""
    shared = shared_volume(a, b)
    union = float(a.size.prod()) + float(b.size.prod()) - shared
    return shared / union if union > 0 else 0.0


def shared_volume(a: FittedBox, b: FittedBox) -> float:
    """Cubic metres that two boxes in one frame share."""
    # In the axes of `a` and in units of its diagonal: tolerances then mean the same everywhere.
    unit = float(a.size.norm())
    if unit == 0 or float((a.centre - b.centre).norm()) >= (unit + float(b.size.norm())) / 2:
        return 0.0
    half_a, half_b = (box.size.double().numpy() / (2 * unit) for box in (a, b))
    turn = (a.rotation.double().mT @ b.rotation.double()).numpy()
    shift = (a.rotation.double().mT @ (b.centre - a.centre).double()).numpy() / unit
    corners_b = SIGNS * half_b @ turn.T + shift
    corners_a = (SIGNS * half_a - shift) @ turn  # seen from b
    from_b = _inside(np.concatenate((corners_b, _through(corners_b, half_a))), half_a)
    from_a = _inside(np.concatenate((corners_a, _through(corners_a, half_b))), half_b)
    return _hull_volume(np.concatenate((from_b, from_a @ turn.T + shift))) * unit**3


def _through(corners: Float[np.ndarray, "8 3"], half: Float[np.ndarray, "3"]) -> np.ndarray:
    """`(n, 3)`: where a box's edges pass through the planes of another's faces, in its axes."""
    start, end = (corners[[edge[k] for edge in EDGES]] for k in (0, 1))
    faces = np.stack((-half, half))[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (faces - start) / (end - start)
    met = (share >= 0) & (share <= 1)
    face, edge, axis = np.nonzero(met)
    points = start[edge] + share[met][:, None] * (end - start)[edge]
    points[np.arange(len(points)), axis] = faces[face, 0, axis]
    return points


def _inside(points: Float[np.ndarray, "n 3"], half: Float[np.ndarray, "3"]) -> np.ndarray:
    return points[(np.abs(points) <= half + _INSIDE).all(1)]


def _hull_volume(points: Float[np.ndarray, "n 3"]) -> float:
    from scipy.spatial import ConvexHull, QhullError

    if len(points) < 4 or np.linalg.svd(points - points[0], compute_uv=False)[2] < _FLAT:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # a sliver thinner than qhull can tell from flat
        return 0.0
