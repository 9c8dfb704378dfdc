# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Average precision: the area under the envelope of precision over recall.

As KITTI and Pascal VOC have it since 2010, but at every recall and not at 40 or 11 of them
(Everingham et al. 2015, eq. 2; Geiger et al. 2012).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

HIT, MISS, NEITHER = 1, 0, -1
SURE = 0.9


@dataclass(frozen=True)
class Ranked:
    """The found boxes of all frames, and whether each is right.

    Attributes:
        confidence: `(n,)`.
        outcome: `(n,)`: `HIT` on a label that counts, `MISS`, or `NEITHER` where none is asked for.
        labels: how many labels count.
    """

    confidence: Float[np.ndarray, "n"]
    outcome: np.ndarray
    labels: int


def match(
    confidence: Float[np.ndarray, "f"],
    overlap: Float[np.ndarray, "f l"],
    counted: Bool[np.ndarray, "l"],
    excused: Bool[np.ndarray, "f"],
    least: float,
) -> np.ndarray:
    """`(f,)` outcome of each found box of one frame.

    The surest box chooses first, of the labels not yet taken the one that it overlaps most, those
    that count before the others.

    Args:
        confidence: of each found box.
        overlap: with each labelled vehicle, 0 to 1.
        counted: labels that count; those that do not are neither found nor missed.
        excused: found boxes that are no mistake where they hit no label.
        least: overlap from which a box is right.
    """
    outcome = np.where(excused, NEITHER, MISS)
    ones, labels = np.nonzero(overlap >= least)
    rank = np.argsort(np.argsort(-confidence, kind="stable"))
    order = np.lexsort((labels, -overlap[ones, labels], ~counted[labels], rank[ones]))
    chosen, taken = set(), set()
    for one, label in zip(ones[order].tolist(), labels[order].tolist()):
        if one not in chosen and label not in taken:
            chosen.add(one)
            taken.add(label)
            outcome[one] = HIT if counted[label] else NEITHER
    return outcome


def pooled(frames: Iterable[tuple[Float[np.ndarray, "_"], np.ndarray, int]]) -> Ranked:
    """Confidences, outcomes and counted labels of many frames as one."""
    parts = list(frames)
    return Ranked(
        np.concatenate([part[0] for part in parts] or [np.empty(0)]),
        np.concatenate([part[1] for part in parts] or [np.empty(0, int)]),
        sum(part[2] for part in parts),
    )


def precision_recall(ranked: Ranked) -> tuple[Float[np.ndarray, "k"], Float[np.ndarray, "k"]]:
    """Precision and recall of what is at least as sure as each confidence, the highest first."""
    asked = ranked.outcome != NEITHER
    confidence, outcome = ranked.confidence[asked], ranked.outcome[asked]
    order = np.argsort(-confidence, kind="stable")
    hits = np.cumsum(outcome[order] == HIT)
    last = np.flatnonzero(np.diff(confidence[order], append=-np.inf) != 0)  # of equals, all
    hits = hits[last]
    return hits / (last + 1), hits / max(ranked.labels, 1)


def average_precision(ranked: Ranked) -> float | None:
    """0 to 1; None where no label counts."""
    if ranked.labels == 0:
        return None
    precision, recall = precision_recall(ranked)
    envelope = np.maximum.accumulate(precision[::-1])[::-1]
    return float(np.sum(np.diff(recall, prepend=0.0) * envelope))


def recall_when_sure(ranked: Ranked, precision: float = SURE) -> float | None:
    """The largest recall at a precision of at least so much, 0 to 1; None without labels."""
    if ranked.labels == 0:
        return None
    precisions, recall = precision_recall(ranked)
    return float(recall[precisions >= precision].max(initial=0.0))
