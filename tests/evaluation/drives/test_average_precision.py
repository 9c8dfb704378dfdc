# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Average precision by hand."""

import numpy as np
import pytest

from wildshape.evaluation.drives.average_precision import (
    HIT,
    MISS,
    NEITHER,
    Ranked,
    average_precision,
    match,
    pooled,
    precision_recall,
    recall_when_sure,
)


def _ranked(outcome: list[int], labels: int, confidence: list[float] | None = None) -> Ranked:
    sure = np.linspace(0.9, 0.1, len(outcome)) if confidence is None else np.array(confidence)
    return Ranked(sure, np.array(outcome, int), labels)


def test_area_under_the_envelope() -> None:
    """Precision 1, 1/2, 2/3, 3/4, 3/5 at recall 1/4, 1/4, 2/4, 3/4, 3/4."""
    ranked = _ranked([HIT, MISS, HIT, HIT, MISS], labels=4)
    precision, recall = precision_recall(ranked)
    np.testing.assert_allclose(precision, [1, 1 / 2, 2 / 3, 3 / 4, 3 / 5])
    np.testing.assert_allclose(recall, [1 / 4, 1 / 4, 2 / 4, 3 / 4, 3 / 4])
    assert average_precision(ranked) == pytest.approx(1 / 4 * 1 + 2 / 4 * 3 / 4)
    assert recall_when_sure(ranked) == pytest.approx(1 / 4)
    assert recall_when_sure(ranked, 0.75) == pytest.approx(3 / 4)


def test_what_is_not_asked_for_changes_nothing() -> None:
    plain = _ranked([HIT, MISS, HIT], 3, [0.9, 0.8, 0.7])
    more = _ranked([NEITHER, HIT, NEITHER, MISS, HIT, NEITHER], 3, [1.0, 0.9, 0.85, 0.8, 0.7, 0.1])
    assert average_precision(more) == pytest.approx(average_precision(plain))


def test_boxes_as_sure_as_each_other_come_together() -> None:
    """Whatever their order: 2 of 3 right, all 2 found."""
    for outcome in ([HIT, HIT, MISS], [MISS, HIT, HIT], [HIT, MISS, HIT]):
        ranked = _ranked(outcome, 2, [0.5, 0.5, 0.5])
        assert average_precision(ranked) == pytest.approx(2 / 3)


@pytest.mark.parametrize(
    ("outcome", "labels", "expected"),
    [([], 2, 0.0), ([MISS], 2, 0.0), ([HIT], 1, 1.0), ([HIT], 2, 0.5), ([MISS], 0, None)],
)
def test_ends(outcome: list[int], labels: int, expected: float | None) -> None:
    assert average_precision(_ranked(outcome, labels)) == expected
    assert recall_when_sure(_ranked(outcome, labels)) == expected


def _matched(
    overlap: list[list[float]],
    confidence: list[float],
    counted: list[bool],
    excused: list[bool] | None = None,
) -> list[int]:
    table = np.array(overlap, float).reshape(len(confidence), len(counted))
    allowed = np.array(excused or [False] * len(confidence), bool)
    return match(np.array(confidence), table, np.array(counted, bool), allowed, 0.5).tolist()


def test_one_label_is_hit_once_by_the_surest() -> None:
    assert _matched([[0.6], [0.9]], [0.8, 0.7], [True]) == [HIT, MISS]
    assert _matched([[0.6], [0.9]], [0.7, 0.8], [True]) == [MISS, HIT]


def test_each_takes_the_label_that_it_overlaps_most() -> None:
    assert _matched([[0.6, 0.9], [0.7, 0.8]], [0.9, 0.8], [True, True]) == [HIT, HIT]
    assert _matched([[0.4, 0.49]], [0.9], [True, True]) == [MISS]


def test_labels_that_do_not_count_are_neither_found_nor_missed() -> None:
    assert _matched([[0.6, 0.9]], [0.9], [True, False]) == [HIT]
    assert _matched([[0.4, 0.9]], [0.9], [True, False]) == [NEITHER]
    assert _matched([[0.9], [0.8]], [0.9, 0.8], [False]) == [NEITHER, MISS]


def test_excused_boxes_still_may_hit() -> None:
    assert _matched([[0.6], [0.0]], [0.9, 0.8], [True], [True, True]) == [HIT, NEITHER]


def test_no_labels_and_no_boxes() -> None:
    assert _matched([[]], [0.9], []) == [MISS]
    assert _matched([], [], [True]) == []


def test_frames_are_pooled_over_their_confidences() -> None:
    frames = [
        (np.array([0.9, 0.3]), np.array([HIT, MISS]), 1),
        (np.array([0.6]), np.array([HIT]), 2),
    ]
    ranked = pooled(frames)
    assert ranked.labels == 3
    assert average_precision(ranked) == pytest.approx(2 / 3)
    assert average_precision(pooled([])) is None
