# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where the pulses of a turn look, what they meet, and which come back."""

from dataclasses import replace

import numpy as np
import pytest

from wildshape.simulate.sensor import HDL32, HDL64
from wildshape.simulate.shapes.solid import box
from wildshape.simulate.street.sweep import (
    NOBODY,
    Echoes,
    cast_turn,
    pulses,
    returned,
    surfaces,
)


@pytest.mark.parametrize(
    ("distance", "cosine", "ground", "glass", "share"),
    [
        (10.0, 1.0, False, False, 0.9),
        (10.0, 1.0, False, True, 0.9 * 0.2),
        (10.0, 0.06, False, False, 0.9 * 0.5),
        (10.0, 0.015, True, False, 0.9 * 0.5),  # what is told of the ground at grazing angles
        (HDL64.max_range_m + 1, 1.0, False, False, 0.0),
        (np.inf, 0.0, False, False, 0.0),
    ],
)
def test_so_many_pulses_come_back(distance, cosine, ground, glass, share) -> None:
    shape = (100, 200)
    echoes = Echoes(*(np.full(shape, value) for value in (distance, cosine, NOBODY, ground, glass)))
    kept = returned(echoes, HDL64, 0.1, 0.2, np.random.default_rng(0))
    assert kept.mean() == pytest.approx(share, abs=0.01)


def test_a_turn_has_the_rings_of_its_sensor_each_at_azimuths_of_its_own_where_they_are() -> None:
    for lidar in (HDL64, HDL32):
        x, y, z = np.moveaxis(pulses(lidar, 0.1).directions.astype(np.float64), -1, 0)
        elevation = np.degrees(np.arcsin(z)).mean(1)
        np.testing.assert_allclose(elevation, lidar.elevation_deg, atol=1e-4)
        azimuth = np.degrees(np.unwrap(np.arctan2(y, x)))
        np.testing.assert_allclose(np.diff(azimuth), lidar.azimuth_step_deg, atol=1e-4)
        begins = (azimuth[:, 0] - azimuth[0, 0] + 180) % 360 - 180
        apart = np.unique((begins / lidar.azimuth_step_deg).round(2))
        assert len(apart) > 32 if lidar.stagger else len(apart) == 1
        assert 0 <= apart.min() <= apart.max() < 1


def test_a_pulse_knows_what_it_met() -> None:
    wall, pane = box((8.0, -2.0, -2.0), (9.0, 2.0, 2.0)), box((-9.0, -2.0, -2.0), (-8.0, 2.0, 2.0))
    pane = replace(pane, glass=np.ones(len(pane.faces), bool))
    turn = pulses(HDL64, 0.1)
    still, T = surfaces([wall, pane], [1, 2], ground=1), np.tile(np.eye(4), (len(turn.times), 1, 1))
    echoes = cast_turn(still, (), turn, T)
    ahead = turn.directions[..., 0] > 0
    met = np.isfinite(echoes.distance)
    assert 1000 < met.sum() < met.size / 2
    np.testing.assert_array_equal(echoes.owner, np.where(met, np.where(ahead, 1, 2), NOBODY))
    np.testing.assert_array_equal(echoes.glass, met & ~ahead)
    np.testing.assert_array_equal(echoes.ground, met & ahead)
