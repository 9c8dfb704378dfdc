# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whether a sensor can have stood at the origin of a scan."""

import numpy as np
from jaxtyping import Float

_NEAR = 0.01  # of the extent: no sensor comes as near to the hull of what it sees
_STEPS = 200


def surrounded(points: Float[np.ndarray, "n 3"]) -> bool:
    """Whether the points lie on all sides of the origin: in their convex hull, or as good as.

    Frank-Wolfe steps to the hull's point nearest to the origin. As soon as all points lie before
    a plane through the origin it is outside; for a real scan that is seen at the first step.

    Args:
        points: of one object, sensor frame.
    """
    exact = points.astype(np.float64)
    near = _NEAR * float(np.linalg.norm(np.ptp(exact, axis=0)))
    place = exact.mean(0)
    for _ in range(_STEPS):
        if float(place @ place) <= near**2:
            return True
        ahead = exact @ place
        back = exact[int(ahead.argmin())]
        if float(ahead.min()) > 0.0:
            return False
        step = place - back
        place = place - step * min(1.0, float(place @ step) / float(step @ step))
    return False
