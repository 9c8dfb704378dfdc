# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A trajectory against the true one (Sturm et al. 2012; Zhang and Scaramuzza 2018)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from wildshape.geometry.transforms.rotation import rotation_angle
from wildshape.geometry.transforms.se3 import SE3

_LEAST_WAY_M = 5.0


@dataclass(frozen=True)
class TrajectoryError:
    """How far a trajectory is off.

    Attributes:
        way_m: truly travelled.
        drift_percent: distance of the last place from the true one, both seen from the first pose,
            in percent of the way; None of a way under 5 m.
        ate_m: absolute trajectory error: root mean square distance from the true places after the
            best rigid alignment, metres.
        rpe_m: relative pose error from scan to scan, root mean square, metres.
        rpe_deg: the same of the turn, degrees.
    """

    way_m: float
    drift_percent: float | None
    ate_m: float
    rpe_m: float
    rpe_deg: float


def trajectory_error(found: SE3, true: SE3) -> TrajectoryError | None:
    """Of `(n,)` poses T_world_sensor each, their worlds being any; None of a single pose."""
    if len(true) < 2:
        return None
    steps = np.linalg.norm(np.diff(true.translation.numpy(), axis=0), axis=1)
    way = float(steps.sum())
    end_found, end_true = (poses[0].inverse() @ poses[-1] for poses in (found, true))
    off = float((end_found.translation - end_true.translation).norm())
    error = (true[:-1].inverse() @ true[1:]).inverse() @ (found[:-1].inverse() @ found[1:])
    turns = np.degrees(rotation_angle(error.rotation).numpy())
    return TrajectoryError(
        way_m=way,
        drift_percent=100 * off / way if way >= _LEAST_WAY_M else None,
        ate_m=_root_mean_square(_after_alignment(found, true)),
        rpe_m=_root_mean_square(error.translation.norm(dim=-1).numpy()),
        rpe_deg=_root_mean_square(turns),
    )


def _after_alignment(found: SE3, true: SE3) -> Float[np.ndarray, "n"]:
    """Distances of places after the rigid motion of least squares (Kabsch 1976)."""
    a, b = found.translation.numpy(), true.translation.numpy()
    a, b = a - a.mean(0), b - b.mean(0)
    u, _, vt = np.linalg.svd(b.T @ a)
    flip = np.diag((1.0, 1.0, np.sign(np.linalg.det(u @ vt))))
    return np.linalg.norm(a @ (u @ flip @ vt).T - b, axis=1)


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
