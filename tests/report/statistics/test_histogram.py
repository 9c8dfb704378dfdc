# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from wildshape.report.statistics.drawing import number
from wildshape.report.statistics.histogram import ANGLES, LENGTHS, Tally


def tally_of(values, edges=LENGTHS):
    found = Tally(edges)
    for part in np.array_split(np.asarray(values), 3):
        found.add(part)
    return found


def test_quantiles_are_good_to_a_bin_and_the_rest_is_exact():
    values = np.random.default_rng(0).lognormal(3.0, 1.0, 20_000)
    found = tally_of(values)
    assert (found.count, found.least, found.most) == (20_000, values.min(), values.max())
    assert found.mean == pytest.approx(values.mean())
    for share in (0.05, 0.5, 0.95):
        assert found.quantile(share) == pytest.approx(np.quantile(values, share), rel=0.01)


def test_angles_are_good_to_a_tenth_of_a_degree():
    values = np.random.default_rng(1).normal(-20.0, 30.0, 5000)
    found = tally_of(values, ANGLES)
    assert found.quantile(0.5) == pytest.approx(np.median(values), abs=0.1)


def test_the_mean_of_azimuths_is_their_mean_direction():
    behind = Tally(ANGLES, circular=True)
    behind.add(np.asarray([179.0, -179.0, 178.0]))
    assert behind.mean == pytest.approx(179.333, abs=1e-3)
    around = Tally(ANGLES, circular=True)
    around.add(np.arange(-180.0, 180.0, 45.0))
    assert np.isnan(around.mean)


def test_what_is_not_finite_is_passed_over():
    found = tally_of([np.nan, 1.0, np.inf])
    assert (found.count, found.most) == (1, 1.0)
    assert np.isnan(Tally(LENGTHS).mean)


@pytest.mark.parametrize("bins", [10, 24])
@pytest.mark.parametrize(
    "values",
    [[5] * 9, [1, 2, 2, 3], range(100, 180), [2.0], np.geomspace(1, 1e5, 500)],
    ids=["one number", "few", "many", "not whole", "decades"],
)
def test_bars_hold_everything_and_whole_numbers_fairly(values, bins):
    values = np.asarray(values)
    edges, heights = tally_of(values).bars(bins)
    assert heights.sum() == pytest.approx(1.0)
    assert (np.diff(edges) > 0).all()
    assert len(heights) <= bins
    for value in np.quantile(values, (0.02, 0.5, 0.98)):
        assert edges[0] <= value <= edges[-1]


def test_whole_numbers_fall_into_bars_of_equal_shares():
    _, heights = tally_of(np.repeat(np.arange(100, 180), 7)).bars(24)
    assert heights[:-1] == pytest.approx(heights[0])


def test_nothing_is_no_negative_number():
    assert [number(value) for value in (-0.0, -12.34)] == ["0", "-12.3"]


def test_an_empty_tally_draws_as_nothing():
    assert Tally(LENGTHS).bars(10)[1].sum() == 0
