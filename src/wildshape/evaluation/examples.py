# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Objects to look at, chosen by their error and never by hand."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from wildshape.errors import BadInputError
from wildshape.evaluation.cases import Case, prepare
from wildshape.evaluation.method import Completer, Method, Registrar
from wildshape.evaluation.protocol import complete_scans
from wildshape.evaluation.results import MethodScores, Results
from wildshape.inference.registration import fuse_scans
from wildshape.ops.threads import alone
from wildshape.records import Points, Track


@dataclass(frozen=True)
class Example:
    """One object as seen, as it is and as it was made; clouds in the object's true frame, metres.

    Attributes:
        label: `best`, `median` or `worst`.
        cd: mean over the track's scans, metres.
        scan: `(n, 3)`, the middle scan.
        truth: `(g, 3)`.
        completed: `(m, 3)`, from the middle scan alone.
        fused: `(f, 3)`, all scans moved by the method; None if it does not register, or refuses.
        rivals: what other methods made of it, by the title of the picture.
        method: the row of the evaluation that made it.
    """

    label: str
    track: str
    cd: float
    scan: Points
    truth: Points
    completed: Points
    fused: Points | None
    rivals: dict[str, Points | None] = field(default_factory=dict)
    method: str = ""


def pick(scores: MethodScores) -> dict[str, tuple[str, float]]:
    """`best`, `median` and `worst` track by its mean CD: their names and that mean."""
    sums: dict[str, list[float]] = {}
    for row in scores.completions:
        sums.setdefault(row.track, []).append(row.error.cd)
    means = sorted((float(np.mean(values)), name) for name, values in sums.items())
    if not means:
        return {}
    chosen = {"best": means[0], "median": means[len(means) // 2], "worst": means[-1]}
    return {label: (name, cd) for label, (cd, name) in chosen.items()}


def gather(
    tracks: Iterable[Track],
    results: Results,
    name: str,
    method: Method,
    *,
    fused_by: Mapping[str, Registrar] = {},
    completed_by: Mapping[str, Completer] = {},
) -> list[Example]:
    """The three objects of a run, completed and fused once more for drawing.

    Args:
        tracks: those of the run.
        results: of the run.
        name: the method's row; it must complete single scans.
        method: the same as in the run.
        fused_by: other methods by the titles of their pictures: the same tracks fused by them.
        completed_by: likewise, the same scans completed by them.
    """
    chosen = pick(results[name])
    if not isinstance(method, Completer):
        return []
    wanted = {track for track, _ in chosen.values()}
    cases = {
        track.name: prepare(track, results.rotate, results.seed, results.limits)
        for track in tracks
        if track.name in wanted
    }

    def made(label: str) -> Example | None:
        track, cd = chosen[label]
        example = _example(label, cd, cases[track], method)
        if example is None:
            return None
        rivals = _rivals(cases[track], fused_by, completed_by)
        return replace(example, rivals=rivals, method=name)

    # As in the run, whose sums are of one thread: a machine of other cores draws the same.
    with alone(1) as thread:
        return [example for example in thread.map(made, chosen) if example is not None]


def _rivals(
    case: Case, fused_by: Mapping[str, Registrar], completed_by: Mapping[str, Completer]
) -> dict[str, Points | None]:
    """What other methods make of the track, in the object's true frame."""
    made = {title: _fused(method, case) for title, method in fused_by.items()}
    for title, method in completed_by.items():
        completed = complete_scans(method, case)[case.middle]
        made[title] = None if completed is None else completed.points
    assert case.T_sensor_object is not None
    T_object_middle = case.T_sensor_object[case.middle].inverse()
    return {t: None if c is None else T_object_middle.apply_numpy(c) for t, c in made.items()}


def _example(label: str, cd: float, case: Case, method: Completer) -> Example | None:
    completed = complete_scans(method, case)[case.middle]
    if completed is None or case.truth is None or case.T_sensor_object is None:
        return None
    T_object_middle = case.T_sensor_object[case.middle].inverse()
    fused = _fused(method, case) if isinstance(method, Registrar) else None
    return Example(
        label=label,
        track=case.name,
        cd=cd,
        scan=T_object_middle.apply_numpy(case.scans[case.middle]),
        truth=case.truth.shape,
        completed=T_object_middle.apply_numpy(completed.points),
        fused=None if fused is None else T_object_middle.apply_numpy(fused),
    )


def _fused(method: Registrar, case: Case) -> Points | None:
    try:
        return fuse_scans(case.scans, method.register_track(case.inputs(), case.sensor))
    except BadInputError:  # the method refuses a scan of this track; its rows have counted that
        return None
