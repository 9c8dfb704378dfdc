# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Objects in the order in which to look at them: the largest error, or least confidence, first."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from wildshape.datasets.tracks.truth import whole_shape
from wildshape.evaluation.metrics import completion_error, registration_error
from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Track
from wildshape.report.content import Cell, Table
from wildshape.report.results import (
    MEANING,
    PROBABILITIES,
    TrackResult,
    chances_of,
    chances_of_scores,
    doubt_of,
    errors_of_scores,
)
from wildshape.report.scene import TRUTH_POINTS

_MEASURED = " CD: of the middle scan's shape; rotation: median of the others to the middle scan."


@dataclass(frozen=True)
class Judged:
    """One track's result and how good it is.

    Attributes:
        result: as it lies in the folder, without its scans: thousands would fill the memory.
        category: of the object.
        cd: Chamfer distance of its middle scan's shape to the truth, metres, if known.
        rotation_deg: median pose error of its scans to the middle one, if the truth is known.
        confidence: the least of its scans.
    """

    result: TrackResult
    category: str = ""
    cd: float | None = None
    rotation_deg: float | None = None
    confidence: float | None = None

    @property
    def chances(self) -> dict[str, float]:
        """What the least confident of its scans states, by the words for it."""
        return chances_of(self._least_sure_first[:1])

    @property
    def warning(self) -> str:
        """Why the least confident of its scans in doubt is not to be trusted, or nothing."""
        doubts = map(doubt_of, self._least_sure_first)
        return next(filter(None, doubts), "")

    @property
    def _least_sure_first(self) -> list[dict[str, Any]]:
        return sorted(self.result.entries, key=_confidence)


def judge(result: TrackResult) -> Judged:
    """Compare with truth where the scans bring it."""
    entries = result.entries
    known = [float(e["confidence"]) for e in entries if e.get("confidence") is not None]
    least = min(known, default=None)
    track, bare = result.track, replace(result, track=None)
    if track is None or track.T_sensor_object is None:
        return Judged(bare, track.category if track else "", confidence=least)
    errors = (_cd(result, track), _rotation(result, track))
    return Judged(bare, track.category, *errors, least)


def worst_first(judged: Iterable[Judged]) -> list[Judged]:
    """By CD, then by pose error, then by confidence; what is not known counts for nothing."""

    def key(one: Judged) -> tuple[float, float, float]:
        confidence = 1.0 if one.confidence is None else one.confidence
        return (-(one.cd or 0.0), -(one.rotation_deg or 0.0), confidence)

    return sorted(judged, key=key)


def index_of(ranked: Sequence[Judged], drawn: int) -> Table:
    """All tracks in a table, the first `drawn` of them leading to their object."""
    known = any((one.cd, one.rotation_deg) != (None, None) for one in ranked)
    by = "error" if known else "confidence"
    first = "the largest error" if by == "error" else "the least confidence"
    columns, rows = _without_empty(
        (
            *("object", "kind", "scans", "CD, m", "rotation, °", "least confidence"),
            *PROBABILITIES.values(),
            "warning",
        ),
        [_row(one) for one in ranked],
    )
    return Table(
        title=f"Objects, {first} first",
        columns=columns,
        rows=rows,
        caption=f"Sorted by {by}; a heading sorts anew, a row leads to its pictures."
        f"{_MEASURED if by == 'error' else ''}{_meaning(columns)}",
        sortable=True,
        objects=tuple(i if i < drawn else None for i in range(len(ranked))),
    )


def scans_of(result: TrackResult) -> Table | None:
    """What is known of each scan of a track."""
    entries = result.entries
    if not entries:
        return None
    points = _counts(result.track)
    columns, rows = _without_empty(
        ("scan", "points", "confidence", *PROBABILITIES.values(), "box, m", "warning"),
        [
            (name := str(e["scan"]), points.get(name), _digits(e.get("confidence"), 2), *_more(e))
            for e in entries
        ],
    )
    caption = _meaning(columns).strip()
    return Table(f"Scans of {result.folder.name}", columns, rows, caption, sortable=True)


def objects_of_scores(scores: Path, method: str) -> Table | None:
    """The tracks of an evaluation by one method's errors, the worst first.

    Raises:
        BadInputError: scores.json is damaged.
    """
    cds, turns, shifts = errors_of_scores(scores, method).values()
    chances = chances_of_scores(scores, method)
    if not {**cds, **turns}:
        return None
    order = sorted(
        {**cds, **turns},
        key=lambda name: (-_mean(cds.get(name)), -float(np.median(turns.get(name) or 0.0))),
    )
    columns, rows = _without_empty(
        (
            *("object", "measured", "CD, m", "worst CD, m", "rotation, °", "translation, m"),
            *PROBABILITIES.values(),
        ),
        [
            (*_score_row(name, cds, turns, shifts), *_stated(chances.get(name, {})))
            for name in order
        ],
    )
    return Table(
        title=f"Objects by the error of {method}, the worst first",
        columns=columns,
        rows=rows,
        caption="Measured: scans, under each seed. CD: mean over an object's scans; rotation and "
        "translation: medians to its middle scan. wildshape view on the same folder shows the "
        f"objects in this order.{_meaning(columns)}",
        sortable=True,
    )


def _row(one: Judged) -> tuple[Cell, ...]:
    scans = len(one.result.scans) or len(one.result.completed_scans())
    errors = (_digits(one.cd, 3), _digits(one.rotation_deg, 1))
    named = (one.result.folder.name, one.category, scans)
    return (*named, *errors, _digits(one.confidence, 2), *_stated(one.chances), one.warning)


def _stated(chances: Mapping[str, float]) -> list[str | None]:
    """A cell for each of the probabilities."""
    return [_digits(chances.get(words), 2) for words in PROBABILITIES.values()]


def _confidence(entry: Mapping[str, Any]) -> float:
    stated = entry.get("confidence")
    return 1.0 if stated is None else float(stated)


def _meaning(columns: Sequence[str]) -> str:
    """What the probabilities mean, where any are shown."""
    return f" {MEANING}" if set(columns) & set(PROBABILITIES.values()) else ""


def _without_empty(
    columns: tuple[str, ...], rows: Sequence[tuple[Cell, ...]]
) -> tuple[tuple[str, ...], tuple[tuple[Cell, ...], ...]]:
    """Columns that say nothing in any row are left out."""
    kept = [i for i in range(len(columns)) if any(row[i] not in (None, "") for row in rows)]
    return tuple(columns[i] for i in kept), tuple(tuple(row[i] for i in kept) for row in rows)


def _digits(value: float | None, digits: int) -> str | None:
    return None if value is None else f"{value:.{digits}f}"


def _cd(result: TrackResult, track: Track) -> float | None:
    poses, name = track.T_sensor_object, track.scan_names[track.middle]
    completed = result.completed(name)
    whole = whole_shape(track)
    if completed is None or whole is None or poses is None:
        return None
    truth = poses[track.middle].apply_numpy(thin(whole, TRUTH_POINTS))
    return completion_error(completed, truth).cd


def _rotation(result: TrackResult, track: Track) -> float | None:
    """Scans without a result are passed over, as they have no line in poses.txt."""
    poses, truth = result.poses(), track.T_sensor_object
    places = {name: i for i, name in enumerate(track.scan_names)}
    kept = [places[name] for name in result.scans if name in places]
    if poses is None or truth is None or len(kept) != len(poses) or len(kept) < 2:
        return None
    known: SE3 = truth[torch.tensor(kept)]
    middle = len(kept) // 2
    error = registration_error(poses[middle] @ poses.inverse(), known, known[middle])
    return float(np.median(np.delete(error.rotation_deg.numpy(), middle)))  # itself is no test


def _counts(track: Track | None) -> dict[str, int]:
    if track is None:
        return {}
    return {name: len(scan) for name, scan in zip(track.scan_names, track.scans)}


def _more(entry: dict[str, Any]) -> tuple[str | None, ...]:
    """Its probabilities, size of the box, and why the result is not to be trusted."""
    box = entry.get("box") or {}
    size = " \N{MULTIPLICATION SIGN} ".join(f"{side:.2f}" for side in box.get("size") or ())
    return (*_stated(chances_of([entry])), size, doubt_of(entry))


def _score_row(
    name: str,
    cds: dict[str, list[float]],
    turns: dict[str, list[float]],
    shifts: dict[str, list[float]],
) -> tuple[Cell, ...]:
    cd, turn, shift = (errors.get(name, []) for errors in (cds, turns, shifts))
    return (
        name,
        max(len(cd), len(turn)),
        _digits(_mean(cd), 3) if cd else None,
        _digits(max(cd, default=None), 3),
        _digits(float(np.median(turn)), 1) if turn else None,
        _digits(float(np.median(shift)), 2) if shift else None,
    )


def _mean(values: list[float] | None) -> float:
    return float(np.mean(values)) if values else 0.0
