# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A chair of three boxes and depth cameras that see it: rays met with boxes, exactly.

Plain 4x4 matrices, so that a test of the readers' frames does not rest on the readers' own classes.
"""

import numpy as np

CHAIR = (
    ((-0.22, -0.20, -0.05), (0.20, 0.20, 0.00)),  # seat
    ((-0.22, -0.20, 0.00), (-0.17, 0.20, 0.42)),  # back, at -x: the chair looks to +x
    ((-0.20, 0.08, -0.40), (-0.13, 0.15, -0.05)),  # one leg, on the left: nothing is symmetric
)


def off_boxes(points, boxes=CHAIR):
    """Distance of points `(n, 3)` to the surface of the union of boxes, from outside or inside."""
    gaps = []
    for low, high in boxes:
        outside = np.maximum(np.maximum(np.asarray(low) - points, points - np.asarray(high)), 0)
        inside = np.minimum(points - np.asarray(low), np.asarray(high) - points).min(axis=1)
        gaps.append(np.where(inside > 0, inside, np.linalg.norm(outside, axis=1)))
    return np.min(gaps, axis=0)


def look_at(eye, target=(0.0, 0.0, 0.0)):
    """`T_camera_world` of a camera at `eye`, z up in the world, upright."""
    forward = np.asarray(target, float) - np.asarray(eye, float)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    T = np.eye(4)
    T[:3, :3] = np.stack((right, np.cross(forward, right), forward))
    T[:3, 3] = -T[:3, :3] @ np.asarray(eye, float)
    return T


def render(T_camera_boxes, camera, boxes=CHAIR):
    """Depth along the optical axis `(h, w)`; infinite where no box is.

    Args:
        T_camera_boxes: `(4, 4)`.
        camera: (fx, fy, cx, cy, width, height); pixel i is seen through i + 0.5.
        boxes: low and high corners.
    """
    fx, fy, cx, cy, width, height = camera
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    rays = np.stack(((u - cx) / fx, (v - cy) / fy, np.ones_like(u)), axis=-1).reshape(-1, 3)
    T = np.linalg.inv(T_camera_boxes)
    origin, toward = T[:3, 3], rays @ T[:3, :3].T
    nearest = np.full(len(rays), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for low, high in boxes:
            a, b = (np.asarray(low) - origin) / toward, (np.asarray(high) - origin) / toward
            enter, leave = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
            hit = (enter < leave) & (enter > 0)
            nearest = np.where(hit, np.minimum(nearest, enter), nearest)
    return nearest.reshape(height, width)


def rendering(solid=None):
    """`render` of the boxes, or of a `simulate.Solid` by Embree, for pictures."""
    if solid is None:
        return render
    from wildshape.simulate.raycast import Scene

    scene = Scene([solid])

    def cast(T_camera_boxes, camera):
        fx, fy, cx, cy, width, height = camera
        u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        rays = np.stack(((u - cx) / fx, (v - cy) / fy, np.ones_like(u)), axis=-1).reshape(-1, 3)
        length = np.linalg.norm(rays, axis=1)
        T = np.linalg.inv(T_camera_boxes)
        toward = (rays / length[:, None]) @ T[:3, :3].T
        hits = scene.cast(np.broadcast_to(T[:3, 3], toward.shape), toward)
        return (hits.distance / length).reshape(height, width)

    return cast


def surface(count, boxes=CHAIR, seed=0):
    """Points `(count, 3)` on the boxes' faces."""
    rng = np.random.default_rng(seed)
    chosen = rng.integers(len(boxes), size=count)
    low, high = (np.asarray(boxes)[chosen, side] for side in (0, 1))
    points = low + rng.random((count, 3)) * (high - low)
    axis, side = rng.integers(3, size=count), rng.integers(2, size=count)
    rows = np.arange(count)
    points[rows, axis] = np.where(side == 1, high[rows, axis], low[rows, axis])
    return points
