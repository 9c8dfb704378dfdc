# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Colours of a share: blue for none, orange for all."""

import numpy as np
from jaxtyping import Float, UInt8

# Blue to orange (Okabe & Ito's two, a light grey between): told apart by colour-blind readers.
_SCALE = np.array([(0, 114, 178), (196, 200, 206), (213, 94, 0)], np.float64)


def shades(shares: Float[np.ndarray, "n"]) -> UInt8[np.ndarray, "n 3"]:
    """One colour, red green blue, for each share of 0 to 1."""
    places = np.linspace(0.0, 1.0, len(_SCALE))
    columns = [np.interp(shares, places, _SCALE[:, i]) for i in range(3)]
    return np.stack(columns, axis=1).astype(np.uint8)
