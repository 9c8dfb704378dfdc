# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Distributions can be read off their axes."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from wildshape.report.statistics.drawing import draw_bars
from wildshape.report.statistics.histogram import LENGTHS, Tally
from wildshape.report.statistics.statistics import Quantity


@pytest.mark.parametrize("most", [55.0, 250.0, 30_000.0])
def test_a_logarithmic_axis_has_three_numbers_at_least(most):
    """From 2 to 55 m it had a single one, 10."""
    tally = Tally(LENGTHS)
    tally.add(np.geomspace(2.2, most, 500))
    assert tally.spans_decades()
    axes = Figure().subplots()
    draw_bars(axes, Quantity("range", "range", "m", "all tracks", tally))
    low, high = axes.get_xlim()
    assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 3
