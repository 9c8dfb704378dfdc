# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The plain twin of refinement (`inference/refine.py`): scan by scan, in NumPy, by k-d trees."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from wildshape.geometry.box import unit_of
from wildshape.inference.config import RefineConfig

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_DEFAULT = RefineConfig()

Cloud = Float[np.ndarray, "_ 3"]


class Refined(NamedTuple):
    """A shape and its pose.

    Attributes:
        shape: canonical frame, metres.
        rotation: of `T_scan_canonical`.
        translation: of the same, metres.
    """

    shape: Cloud
    rotation: Float[np.ndarray, "3 3"]
    translation: Float[np.ndarray, "3"]


class _Planes(NamedTuple):
    """The plane of the shape around each scan point: `(n, 3)` places and unit normals."""

    at: np.ndarray
    normal: np.ndarray


def refine(
    scan: Cloud,
    shape: Cloud,
    rotation: Float[np.ndarray, "3 3"],
    translation: Float[np.ndarray, "3"],
    *,
    mirror: bool,
    up: Float[np.ndarray, "3"] | None = None,
    config: RefineConfig = _DEFAULT,
) -> Refined:
    """Pose and shape after a look at the scan they came from.

    Args:
        scan: at least a handful of points, metres.
        shape: canonical frame.
        rotation: of `T_scan_canonical`, good to some ten degrees.
        translation: of the same, good to some decimetres.
        mirror: what was seen of one side of y = 0 is known of the other.
        up: canonical direction that the scan's z axis points in, if it was taken level; what is
            far from it (`tilted_deg`) is taken for tilted and left so.
        config: how it is fitted.
    """
    exact = shape.astype(np.float64)
    unit = unit_of(float(np.linalg.norm(np.ptp(exact, axis=0))))
    order = np.random.default_rng(0).permutation(len(scan))
    points = scan[order[: config.scan_points]].astype(np.float64)
    start = Refined(exact / unit, rotation, translation / unit)
    fitted = _fitted(points / unit, start, up, config)
    seen = (points / unit - fitted.translation) @ fitted.rotation
    drawn = drawn_to_scan(fitted.shape, seen, mirror=mirror, config=config)
    moved = fitted.translation * unit
    return Refined((drawn * unit).astype(shape.dtype), fitted.rotation, moved)


def _fitted(points: Cloud, found: Refined, up: np.ndarray | None, config: RefineConfig) -> Refined:
    """The nine numbers fitted."""
    from scipy.spatial import KDTree

    tree = KDTree(found.shape, balanced_tree=False)
    before = _off(tree, (points - found.translation) @ found.rotation, config.kernel_m)
    motion, planes = np.zeros(9), _Planes(points, points)
    R, t = (part.astype(np.float64) for part in found[1:])
    for step in range(config.iterations):
        stretch = np.exp(motion[6:])
        local = (points - t) @ R
        if step in config.matched_at:
            planes = _planes(tree, local / stretch, config.plane_points)
        A, b = _fit(local, planes, stretch, motion, config)
        if up is not None:
            tilt = _level(R[2], up, config)
            A[:3, :3] += tilt[0]
            b[:3] += tilt[1]
        change = -np.linalg.solve(A, b)
        motion += change
        R = R @ _turn(change[:3]).T
        t = t - R @ change[3:6]
    stretch = np.exp(motion[6:])
    level_rad = np.radians(config.level_deg)
    askew = up is not None and float(np.linalg.norm(found.rotation[2] - up)) > level_rad
    allowed = before * (config.level_may_cost if askew else 1.0)
    if _off(tree, (points - t) @ R / stretch, config.kernel_m) > allowed:
        return found
    return Refined(found.shape * stretch, R, t)


def _off(tree: "KDTree", points: Cloud, most_m: float) -> float:
    """Mean distance of points to a shape, each at most so many metres."""
    return float(np.minimum(tree.query(points)[0], most_m).mean())


def _planes(tree: "KDTree", points: Cloud, count: int) -> _Planes:
    """Planes through `count` of the shape's points around each point, unstretched frame."""
    _, index = tree.query(points, k=count)
    around = tree.data[index]
    middle = around.mean(axis=1)
    off = around - middle[:, None]
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", off, off))
    return _Planes(middle, axes[:, :, 0])


def _fit(
    local: Cloud,
    planes: _Planes,
    stretch: np.ndarray,
    motion: np.ndarray,
    config: RefineConfig,
) -> tuple[np.ndarray, np.ndarray]:
    """A and b of a Gauss-Newton step, A x = -b, of the nine numbers.

    `motion` is how far they are from the prior.
    """
    at, normal = planes.at * stretch, planes.normal / stretch
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    off = local - at
    residual = (off * normal).sum(axis=1)
    kernel = (1 + (off**2).sum(axis=1) / config.kernel_m**2) ** -2  # Geman-McClure
    weight = kernel * config.effective_points / len(local) / config.error_m**2
    rows = np.concatenate((np.cross(local, normal), normal, -normal * at), axis=1)
    prior = (np.radians(config.prior_deg), config.prior_m, config.prior_stretch)
    trust = np.repeat(prior, 3) ** -2
    A = (rows * weight[:, None]).T @ rows + np.diag(trust)
    b = rows.T @ (weight * residual) + trust * motion
    return A, b


def _level(now: np.ndarray, up: np.ndarray, config: RefineConfig) -> tuple[np.ndarray, np.ndarray]:
    """What a level sensor adds for the rotation: `now` is its z axis, canonical frame."""
    off = now - up
    level, tilted = np.radians((config.level_deg, config.tilted_deg))
    weight = level**-2 * (1 + off @ off / tilted**2) ** -2  # Geman-McClure
    across = -_cross(now)  # of a turn by w, `now` becomes `now` + w x `now`
    return weight * across.T @ across, weight * across.T @ off


def _turn(w: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation by |w| radians about w (Rodrigues)."""
    angle = float(np.linalg.norm(w))
    if angle < 1e-12:
        return np.eye(3)
    cross = _cross(w / angle)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _cross(w: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix of w x."""
    x, y, z = w
    return np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))


def drawn_to_scan(
    shape: Cloud, seen: Cloud, *, mirror: bool, config: RefineConfig = _DEFAULT
) -> Cloud:
    """The shape's points drawn to the mean of what was seen around them; the others stay.

    Args:
        shape: canonical frame.
        seen: the scan, the same frame.
        mirror: draw to its reflection in y = 0 too.
        config: how far, and how stiffly.
    """
    from scipy.spatial import KDTree

    from wildshape.geometry.sampling import voxel_thin

    both = np.concatenate((seen, seen * (1, -1, 1))) if mirror else seen
    thin = voxel_thin(both.astype(np.float32), config.voxel_m).astype(np.float64)
    most = min(config.drawn_by, len(thin))
    apart, index = KDTree(thin).query(shape, k=most, distance_upper_bound=2.5 * config.reach_m)
    apart, index = apart.reshape(-1, most), index.reshape(-1, most)
    weight = np.exp(-((apart / config.reach_m) ** 2))  # beyond the bound: 0
    near = thin[np.minimum(index, len(thin) - 1)]
    total = weight.sum(axis=1, keepdims=True) + config.stiffness
    return ((weight[..., None] * near).sum(axis=1) + config.stiffness * shape) / total
