# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Colours of the viewer's points: darker at the foot, or by confidence, guess or error."""

import numpy as np
import torch
from jaxtyping import Float, UInt8

from wildshape.geometry.box import extent, unit_of
from wildshape.geometry.meshing import share_colours
from wildshape.ops.nearest import nearest
from wildshape.records import Points

Rgb = UInt8[np.ndarray, "n 3"]
PLAIN, CONFIDENCE, GUESSED, WRONG = "plain", "confidence", "seen or guessed", "distance to truth"
COLOURINGS = (PLAIN, CONFIDENCE, GUESSED, WRONG)
LEGENDS = {
    PLAIN: "darker points lie lower",
    CONFIDENCE: "of the scan: orange 0, blue 1",
    GUESSED: "blue beside a measured point, orange 0.5 m from any (less for objects below 5 m)",
    WRONG: "blue on the true surface, orange 0.3 m off it (less for objects below 5 m)",
}
_FAR_M = {GUESSED: 0.5, WRONG: 0.3}


def by_height(heights: Float[np.ndarray, "n"], colour: str) -> Rgb:
    """One colour, darker at the foot; `heights` along the drawing's z."""
    base = np.array(rgb(colour), np.float64)
    low, high = (heights.min(), heights.max()) if len(heights) else (0.0, 1.0)
    share = ((heights - low) / max(float(high - low), 1e-6))[:, None]
    return (base * 0.5 * (1 - share) + (base * 0.8 + 51) * share).astype(np.uint8)


def completed_colours(
    colouring: str,
    points: Points,
    confidence: float | None,
    scan: Points,
    truth: Points | None,
) -> Rgb | None:
    """Colours of a completed shape; None where they stay plain. All clouds in one frame."""
    if colouring == CONFIDENCE and confidence is not None:
        return np.repeat(share_colours(np.array([1.0 - confidence])), len(points), axis=0)
    others = {GUESSED: scan, WRONG: truth}.get(colouring)
    if others is None or not len(others):
        return None
    return by_distance(points, others, _FAR_M[colouring] * unit_of(extent(points)))


def by_distance(points: Points, others: Points, far: float) -> Rgb:
    """Points by their distance to the nearest of `others`, same frame, metres."""
    middle = points.mean(0)
    a, b = (torch.from_numpy(np.ascontiguousarray(p - middle))[None] for p in (points, others))
    distance = nearest(a.float(), b.float()).distance_squared[0].clamp(min=0).sqrt().numpy()
    return share_colours(np.minimum(distance / far, 1.0))


def rgb(colour: str) -> tuple[int, int, int]:
    """`#rrggbb` as three numbers."""
    red, green, blue = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue


def css(confidence: float) -> str:
    """A confidence as a CSS colour."""
    r, g, b = share_colours(np.array([1.0 - confidence]))[0]
    return f"rgb({r},{g},{b})"
