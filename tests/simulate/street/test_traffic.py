# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Vehicles of one lane through long drives."""

from itertools import combinations

import numpy as np
import pytest

from wildshape.simulate.shapes.solid import box
from wildshape.simulate.street.street import LANE_M, LEAD_M, random_street
from wildshape.simulate.street.traffic import traffic

LONG = box((-4.5, -0.9, 0.0), (4.5, 0.9, 1.6))


@pytest.mark.parametrize("seed", range(8))
def test_nobody_drives_through_another_in_two_minutes(seed: int) -> None:
    seconds = 120.0
    street = random_street(seed, seconds, None, lambda _: LONG)
    actors = traffic(street, float(street.ego.at(seconds)) + LEAD_M, seconds, seed)
    lane = [actor for actor in actors if actor.moving and abs(actor.lateral) == LANE_M / 2]
    times = np.linspace(0.0, seconds, 600)
    for one, other in combinations(lane, 2):
        if one.lateral == other.lateral:
            apart = np.abs(one.motion.at(times) - other.motion.at(times))
            assert apart.min() > (one.size[0] + other.size[0]) / 2
