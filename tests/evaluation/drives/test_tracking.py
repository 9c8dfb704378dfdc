# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""HOTA, identity switches and purity of cases worked out by hand.

Random cases were compared with TrackEval 1.3.0, too: HOTA, DetA and AssA to 1e-16, the same
switches; it needs OpenCV, so that it is no dependency.
"""

import tracemalloc

import numpy as np
import pytest

from wildshape.evaluation.drives.tracking import ALPHAS, Pairs, hota, identity_switches, purity


def _frame(found: list[int], true: list[int], overlap: list[list[float]] | None = None) -> Pairs:
    """By default a found box lies exactly on the vehicle of the same place in the list."""
    table = np.eye(len(found), len(true)) if overlap is None else np.array(overlap, float)
    return Pairs(np.array(found, int), np.array(true, int), table.reshape(len(found), len(true)))


def test_all_right() -> None:
    found = hota([_frame([0, 1], [0, 1])] * 5)
    assert found is not None
    assert (found.hota, found.detection, found.association) == pytest.approx((1, 1, 1))


def test_a_track_in_two_halves() -> None:
    """Of 4 hits each is associated with 2 of 4: A = 2 / (4 + 2 - 2); HOTA is its root."""
    frames = [_frame([0], [0])] * 2 + [_frame([1], [0])] * 2
    found = hota(frames)
    assert found is not None
    assert found.detection == pytest.approx(1.0)
    assert found.association == pytest.approx(0.5)
    assert found.hota == pytest.approx(0.5**0.5)
    assert identity_switches(frames) == 1


def test_boxes_that_are_off_hit_at_small_overlaps_only() -> None:
    """IoU 0.6: at 12 of the 19 overlaps."""
    found = hota([_frame([0], [0], [[0.6]])] * 3)
    assert found is not None
    assert len(ALPHAS) == 19
    assert found.hota == pytest.approx(12 / 19)


def test_a_miss_and_a_mistake() -> None:
    """One hit, one miss, one mistake: DetA 1/3; the hit's vehicle is there twice: AssA 1/2."""
    found = hota([_frame([0], [0]), _frame([1], [0], [[0.0]])])
    assert found is not None
    assert found.detection == pytest.approx(1 / 3)
    assert found.association == pytest.approx(1 / 2)
    assert found.hota == pytest.approx((1 / 6) ** 0.5)


def test_two_drives_are_one_whose_tracks_do_not_mix() -> None:
    """Association is averaged over hits: 4 of 1/2 and 4 of 1."""
    first = [_frame([0], [0])] * 2 + [_frame([1], [0])] * 2
    second = [_frame([2], [1])] * 4
    both = hota(first + second)
    assert both is not None
    assert both.association == pytest.approx((4 * 0.5 + 4 * 1.0) / 8)


def test_nothing_found_and_nothing_there() -> None:
    empty = hota([_frame([], [0])])
    assert empty is not None
    assert (empty.hota, empty.detection, empty.association) == (0, 0, 0)
    assert hota([_frame([0], [])]) is None
    assert identity_switches([_frame([0], []), _frame([], [0])]) == 0


def test_memory_does_not_grow_with_all_the_pairs_that_there_could_be() -> None:
    numbers = (np.arange(first, first + 3) for first in range(0, 1800, 3))
    frames = [Pairs(some, some, np.eye(3)) for some in numbers]
    tracemalloc.start()
    found = hota(frames)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found == pytest.approx(hota(frames[:1]))
    assert most < 8 * 1800**2  # a number for each pair


def test_an_identity_goes_on_even_where_another_box_fits_better() -> None:
    frames = [_frame([0], [0]), _frame([0, 1], [0], [[0.6], [0.9]]), _frame([0], [0])]
    assert identity_switches(frames) == 0


def test_a_switch_counts_over_a_gap_and_back_again() -> None:
    frames = [_frame([0], [0]), _frame([], [0]), _frame([1], [0]), _frame([0], [0])]
    assert identity_switches(frames) == 2
    assert identity_switches([_frame([0], [0]), _frame([1], [0], [[0.4]])]) == 0


def test_purity() -> None:
    """Track 0 goes from vehicle 0 to 1; vehicle 0 has two tracks; nobody finds vehicle 2."""
    frames = [
        _frame([0], [0, 2], [[0.8, 0.0]]),
        _frame([0, 1], [1, 0], [[0.5, 0.0], [0.0, 0.4]]),
        _frame([1, 3], [0, 1], [[0.2, 0.0], [0.0, 0.0]]),
    ]
    found = purity(frames)
    assert (found.vehicles, found.vehicles_found, found.tracks) == (3, 2, 2)
    assert found.tracks_per_vehicle == pytest.approx((2 + 1) / 2)
    assert found.impure_tracks == 1
    assert purity([_frame([0], [0], [[0.1]])]).tracks_per_vehicle is None
