# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When points were met, told from the order in which a file lists them."""

import numpy as np
import pytest

from wildshape.drives.recordings.beam_order import met_in_order

TURN_S, BEAMS, COLUMNS, SPEED = 0.05, 32, 1086, 15.0


def sweep(sense=-1):
    """A turn of 32 beams from 0.3 turns on, a third of it without return; corrected for 15 m/s.

    Returns the points, one column after the other, and when each was met.
    """
    rng = np.random.default_rng(0)
    share = np.repeat((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5, BEAMS)
    azimuth = 2 * np.pi * (0.3 + sense * share) + rng.normal(0, 0.002, len(share))
    up = np.tile(np.deg2rad(np.linspace(-30, 10, BEAMS)), COLUMNS)
    away = rng.uniform(4, 50, len(share))
    level = away * np.cos(up)
    points = np.stack((level * np.cos(azimuth), level * np.sin(azimuth), away * np.sin(up)), axis=1)
    met = TURN_S * share
    points[:, 1] += SPEED * met
    back = (rng.random(len(share)) > 0.2) & ((share < 0.1) | (share > 0.2))
    return points[back].astype(np.float32), met[back]


@pytest.mark.parametrize("sense", [1, -1])
def test_columns_one_after_the_other_tell_the_time(sense):
    points, met = sweep(sense)
    found = met_in_order(points, TURN_S)
    assert found is not None
    wrong = found - met
    assert np.abs(wrong - np.median(wrong)).max() < 0.04 * TURN_S  # near points were moved
    assert np.abs(np.median(wrong)) < 0.01 * TURN_S


def test_any_other_order_tells_nothing():
    points, _ = sweep()
    ring = np.arctan2(points[:, 2], np.hypot(points[:, 0], points[:, 1]))
    by_chance = np.random.default_rng(0).permutation(len(points))
    for rows in (np.argsort(ring, kind="stable"), by_chance, slice(0, len(points) // 2), slice(9)):
        assert met_in_order(points[rows], TURN_S) is None
    assert met_in_order(np.concatenate((points, points)), TURN_S) is None  # two turns
    assert met_in_order(points[:0], TURN_S) is None
