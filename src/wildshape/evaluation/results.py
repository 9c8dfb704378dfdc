# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a run of the protocol found: one record a scan, and what was left out by name."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from wildshape.evaluation.metrics import BoxScore, CompletionError, RegistrationScore

Rotate = Literal["none", "yaw", "so3"]


@dataclass(frozen=True)
class Limits:
    """What of a track counts.

    Attributes:
        min_points: of a scan, finite ones; others are left out, and named.
        truth_points: at most; more are thinned by chance, the same ones every time. So many put a
            floor of 0.03 m under the precision of a car.
        max_scans: of a track, chosen evenly after the truth was accumulated from all; None: all.
    """

    min_points: int = 16
    truth_points: int = 8192
    max_scans: int | None = None


@dataclass(frozen=True)
class Skipped:
    """One scan that did not count, or one track completed as a whole (then its middle scan).

    Attributes:
        reason: in a few words, the same for all of a kind.
    """

    track: str
    scan: str
    reason: str


@dataclass(frozen=True)
class CompletionScore:
    """One completed scan, or one track completed as a whole (then `scan` is its middle one).

    Attributes:
        error: against the shape, or the mirrored accumulation where the shape is not known.
        error_partial: against the accumulation as it is; None where the shape is known.
        truth: `shape` or `mirrored`.
        points: of the prediction.
        truth_points: of the truth.
        cd_floor: CD of perfect points as many as these, drawn at random, metres (METHOD 8).
        partial_points: of the accumulation as it is; None where the shape is known.
        confidence: 0 to 1, as the method states it; None if it states none.
        box: of the object, if the method draws one.
        p_pose: probability of a heading within 10 degrees, as the method states it.
        p_box: the same of an overlap of 0.7 with the true box in bird's eye view.
        scans: that it counts for: of a whole track all.
    """

    track: str
    scan: str
    error: CompletionError
    error_partial: CompletionError | None
    truth: str
    points: int
    truth_points: int
    cd_floor: float
    partial_points: int | None = None
    confidence: float | None = None
    box: BoxScore | None = None
    p_pose: float | None = None
    p_box: float | None = None
    scans: int = 1


@dataclass(frozen=True)
class MethodScores:
    """One method under one seed.

    Attributes:
        completions: one a scan, or one a track.
        registrations: one a scan.
        skipped: what counted in neither.
        about: method and settings in a line, if it says.
    """

    name: str
    completions: tuple[CompletionScore, ...]
    registrations: tuple[RegistrationScore, ...]
    skipped: tuple[Skipped, ...]
    about: str = ""


@dataclass(frozen=True)
class Results:
    """One run of the protocol."""

    rotate: Rotate
    seed: int
    methods: tuple[MethodScores, ...]
    limits: Limits = Limits()

    def __getitem__(self, name: str) -> MethodScores:
        return {scores.name: scores for scores in self.methods}[name]


def pooled(runs: Sequence[Results]) -> Results:
    """All scans of runs that differ in their seed only, row by row, as if of the first."""
    rows: dict[str, MethodScores] = {}
    for row in (row for run in runs for row in run.methods):
        known = rows.setdefault(
            row.name, replace(row, completions=(), registrations=(), skipped=())
        )
        rows[row.name] = replace(
            known,
            completions=known.completions + row.completions,
            registrations=known.registrations + row.registrations,
            skipped=known.skipped + row.skipped,
        )
    return replace(runs[0], methods=tuple(rows.values()))
