# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A shared template: canonical shapes stay near their mean, so that they share one frame.

Beyond the paper. Without it each object may settle in either of two headings a half turn apart
(METHOD 12.2): a decoder free to draw every object alone has no reason to prefer one. A shape that
must stay near the mean of all shapes pays for being turned.
"""

from jaxtyping import Float
from torch import Tensor


def template_deviation(shapes: Float[Tensor, "I P 3"]) -> Float[Tensor, ""]:
    """Mean distance, metres, of canonical points from the batch's mean of the same points.

    The decoder's j-th outputs correspond across shapes, so no search is needed.
    """
    deviation = shapes - shapes.mean(0, keepdim=True)
    return deviation.square().sum(-1).clamp_min(1e-12).sqrt().mean()
