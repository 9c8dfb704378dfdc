# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How well boxes of successive frames are held together: HOTA, identity switches, purity.

HOTA: Luiten et al., "HOTA: A Higher Order Metric for Evaluating Multi-Object Tracking", IJCV 2021.
Identity switches: Bernardin and Stiefelhagen, "Evaluating Multiple Object Tracking Performance:
The CLEAR MOT Metrics", 2008. Both are computed as TrackEval does, which has the authors' code.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

ALPHAS = np.arange(0.05, 0.99, 0.05)
_TIE = np.finfo(float).eps
_SWITCH_IOU, _BELONGS_IOU = 0.5, 0.3
_NONE = -1  # the number of no track
_KEPT = 1000.0  # an identity that goes on is worth more than any overlap


@dataclass(frozen=True)
class Pairs:
    """One frame: who was found, who is there, and how much they overlap.

    Attributes:
        found: `(f,)` numbers of the tracks found.
        true: `(t,)` numbers of the labelled vehicles.
        overlap: `(f, t)`, 0 to 1.
    """

    found: Int[np.ndarray, "f"]
    true: Int[np.ndarray, "t"]
    overlap: Float[np.ndarray, "f t"]


@dataclass(frozen=True)
class Hota:
    """Means over the overlaps 0.05, 0.10, ..., 0.95; each 0 to 1.

    Attributes:
        hota: `sqrt(detection * association)`, averaged.
        detection: DetA.
        association: AssA.
    """

    hota: float
    detection: float
    association: float


def hota(frames: Sequence[Pairs]) -> Hota | None:
    """Higher order tracking accuracy; None where nothing is labelled."""
    trues = _most(frame.true for frame in frames)
    founds = _most(frame.found for frame in frames)
    if trues == 0:
        return None
    true_count = _counts((frame.true for frame in frames), trues)
    found_count = _counts((frame.found for frame in frames), founds)
    pairs, matches = _matches(frames, found_count, true_count)
    hits = matches.sum(1)
    all_true, all_found = true_count.sum(), found_count.sum()
    detection = hits / np.maximum(all_true + all_found - hits, 1)
    shared = found_count[pairs // trues] + true_count[pairs % trues] - matches
    association = (matches * matches / np.maximum(shared, 1)).sum(1) / np.maximum(hits, 1)
    return Hota(
        float(np.sqrt(detection * association).mean()),
        float(detection.mean()),
        float(association.mean()),
    )


def _most(numbers: object) -> int:
    return max((int(n.max()) + 1 for n in numbers if len(n)), default=0)  # type: ignore[attr-defined]


def _counts(numbers: Iterable[np.ndarray], most: int) -> np.ndarray:
    """In how many frames each track is."""
    return np.bincount(np.concatenate(list(numbers)), minlength=most).astype(float)


def _numbered(parts: Iterable[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of tracks that meet at all, and which of them each is: few of all that there could be.

    A pair is `found * trues + true`.
    """
    return np.unique(np.concatenate(list(parts)), return_inverse=True)


def _matches(
    frames: Sequence[Pairs], found_count: np.ndarray, true_count: np.ndarray
) -> tuple[np.ndarray, Float[np.ndarray, "alphas pairs"]]:
    """Pairs of tracks, and in how many frames each is matched at each overlap."""
    assigned = [
        _assigned(alike * frame.overlap)
        for frame, alike in zip(frames, _alignment(frames, found_count, true_count))
    ]
    pairs, which = _numbered(
        frame.found[rows] * len(true_count) + frame.true[columns]
        for frame, (rows, columns) in zip(frames, assigned)
    )
    overlap = np.concatenate([frame.overlap[at] for frame, at in zip(frames, assigned)])
    kept = overlap >= ALPHAS[:, None] - _TIE
    matches = np.array([np.bincount(which[one], minlength=len(pairs)) for one in kept], float)
    return pairs, matches


def _alignment(
    frames: Sequence[Pairs], found_count: np.ndarray, true_count: np.ndarray
) -> Iterator[np.ndarray]:
    """`(f, t)` of each frame: how much its tracks go together over all frames."""
    trues = len(true_count)
    cells = [np.nonzero(frame.overlap > _TIE) for frame in frames]
    pairs, which = _numbered(
        frame.found[rows] * trues + frame.true[columns]
        for frame, (rows, columns) in zip(frames, cells)
    )
    share = np.concatenate([_shares(frame.overlap)[at] for frame, at in zip(frames, cells)])
    together = np.bincount(which, share, len(pairs))
    either = found_count[pairs // trues] + true_count[pairs % trues] - together
    alike = (together / np.maximum(either, _TIE))[which]
    ends = np.cumsum([len(rows) for rows, _ in cells])
    for frame, at, part in zip(frames, cells, np.split(alike, ends[:-1])):
        found = np.zeros_like(frame.overlap)
        found[at] = part
        yield found


def _shares(overlap: np.ndarray) -> np.ndarray:
    """Of each overlap, of all that its two have in the frame."""
    either = overlap.sum(0)[None] + overlap.sum(1)[:, None] - overlap
    return np.divide(overlap, either, out=np.zeros_like(overlap), where=either > _TIE)


def _assigned(worth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the one-to-one assignment that is worth most."""
    from scipy.optimize import linear_sum_assignment

    return linear_sum_assignment(worth, maximize=True)


def identity_switches(frames: Sequence[Pairs]) -> int:
    """How often a vehicle is found under another number than when it was last found."""
    latest: dict[int, int] = {}
    before: dict[int, int] = {}
    switches = 0
    for frame in frames:
        if not (len(frame.found) and len(frame.true)):
            continue  # what was found before the gap goes on after it
        kept = frame.found[:, None] == [before.get(t, _NONE) for t in frame.true.tolist()]
        worth = _KEPT * kept + frame.overlap
        worth[frame.overlap < _SWITCH_IOU - _TIE] = 0
        rows, columns = _assigned(worth)
        good = worth[rows, columns] > _TIE
        before = {}
        for f, t in zip(frame.found[rows[good]].tolist(), frame.true[columns[good]].tolist()):
            switches += latest.get(t, f) != f
            latest[t] = before[t] = f
    return switches


@dataclass(frozen=True)
class Purity:
    """How tracks and vehicles belong together.

    Attributes:
        vehicles: labelled.
        vehicles_found: to which at least one track belongs.
        tracks: that belong to a vehicle.
        tracks_per_vehicle: mean over the vehicles found; None without any.
        impure_tracks: that belong to more than one vehicle.
    """

    vehicles: int
    vehicles_found: int
    tracks: int
    tracks_per_vehicle: float | None
    impure_tracks: int


def purity(frames: Sequence[Pairs]) -> Purity:
    """A track belongs to a vehicle if it is assigned to it in a frame, at an IoU of 0.3 or more."""
    vehicles_of: dict[int, set[int]] = defaultdict(set)
    tracks_of: dict[int, set[int]] = defaultdict(set)
    for frame in frames:
        for row, column in belonging(frame.overlap):
            found, true = int(frame.found[row]), int(frame.true[column])
            vehicles_of[found].add(true)
            tracks_of[true].add(found)
    counts = [len(tracks) for tracks in tracks_of.values()]
    return Purity(
        vehicles=len({int(t) for frame in frames for t in frame.true}),
        vehicles_found=len(tracks_of),
        tracks=len(vehicles_of),
        tracks_per_vehicle=float(np.mean(counts)) if counts else None,
        impure_tracks=sum(len(vehicles) > 1 for vehicles in vehicles_of.values()),
    )


def belonging(overlap: Float[np.ndarray, "f t"]) -> list[tuple[int, int]]:
    """Which found box belongs to which label: the assignment of most overlap, IoU 0.3 or more."""
    worth = np.where(overlap >= _BELONGS_IOU, overlap, 0.0)
    rows, columns = _assigned(worth)
    return [(int(r), int(c)) for r, c in zip(rows, columns) if worth[r, c] > 0]
