# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The evaluation protocol of METHOD 8: methods see points, rays and the sensor, never the truth."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, get_args

import numpy as np
import torch

from wildshape.arguments import expect
from wildshape.errors import BadInputError
from wildshape.evaluation.cases import Case, Truth, prepare
from wildshape.evaluation.method import (
    Answer,
    BatchCompleter,
    CanonicalCompleter,
    Completer,
    Described,
    Method,
    Registrar,
    SightedCompleter,
    TrackCompleter,
)
from wildshape.evaluation.metrics import (
    RegistrationScore,
    box_score,
    completion_error,
    distance_floor,
    registration_error,
)
from wildshape.evaluation.refusals import taken
from wildshape.evaluation.results import (
    CompletionScore,
    Limits,
    MethodScores,
    Results,
    Rotate,
    Skipped,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.parallel.team import ALONE, Team
from wildshape.records import Box, Points, Sensor, Track

ALL_SCANS = Limits()
Progress = Callable[[int, str], None]
REFUSED = "refused by the method"
NOT_FINITE = "prediction empty or not finite"
ONE_SCAN = "a track of one scan"

Found = TypeVar("Found")


@dataclass
class _Ledger:
    """What one row of the table is made of, while it grows."""

    completions: list[CompletionScore] = field(default_factory=list)
    registrations: list[RegistrationScore] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)

    def skip(self, case: Case, scan: int, reason: str) -> None:
        self.skipped.append(Skipped(case.name, case.scan_names[scan], reason))

    def extend(self, more: "_Ledger") -> None:
        self.completions += more.completions
        self.registrations += more.registrations
        self.skipped += more.skipped

    def close(self, name: str, about: str) -> MethodScores:
        return MethodScores(
            name=name,
            completions=tuple(self.completions),
            registrations=tuple(self.registrations),
            skipped=tuple(self.skipped),
            about=about,
        )


def run(
    methods: Mapping[str, Method],
    tracks: Iterable[Track],
    rotate: Rotate = "none",
    seed: int = 0,
    progress: Progress | None = None,
    *,
    limits: Limits = ALL_SCANS,
    helpers: Team = ALONE,
) -> Results:
    """Every method on every track.

    A method that completes both from one scan and from a whole track gets two rows, the second
    named `<name>, whole track`.

    Args:
        methods: by the name of their row.
        tracks: read once, one held at a time.
        rotate: input protocol, see `turn_track`.
        seed: of the rotations.
        progress: called after each track with the number done and its name.
        limits: what of a track counts.
        helpers: who does the work.

    Raises:
        BadInputError: a method answers of fewer or more scans than it took, or no clouds of points,
            or is none; a protocol that there is not.
    """
    _check(methods, rotate)
    if isinstance(tracks, str | Path | Track):
        raise BadInputError("tracks: expected several; pass what open_tracks gives, or a list.")
    ledgers: dict[str, _Ledger] = {name: _Ledger() for name in methods}
    task = _TrackEvaluation(methods, rotate, seed, limits)
    for done, found in enumerate(helpers.in_order(task, tracks), start=1):
        for name, ledger in found.ledgers.items():
            ledgers.setdefault(name, _Ledger()).extend(ledger)
        if progress is not None:
            progress(done, found.track)
    about = {name: m.about for name, m in methods.items() if isinstance(m, Described)}
    rows = tuple(ledger.close(name, about.get(name, "")) for name, ledger in ledgers.items())
    return Results(rotate, seed, rows, limits)


def _check(methods: Mapping[str, Method], rotate: Rotate) -> None:
    if rotate not in get_args(Rotate):
        raise BadInputError(
            f"rotate {rotate!r} is unknown; use one of {', '.join(get_args(Rotate))}."
        )
    expect(methods, Mapping, "methods", "pass a dict with the name of each")
    for name, method in methods.items():
        if not isinstance(method, get_args(Method)):
            raise BadInputError(
                f"{name}: neither completes nor registers; `evaluation/method.py` says how."
            )


class _OfTrack(NamedTuple):
    """What the rows say of one track."""

    track: str
    ledgers: dict[str, _Ledger]


@dataclass(frozen=True)
class _TrackEvaluation:
    """Every method on one track."""

    methods: Mapping[str, Method]
    rotate: Rotate
    seed: int
    limits: Limits

    def __call__(self, track: Track) -> _OfTrack:
        ledgers: dict[str, _Ledger] = {name: _Ledger() for name in self.methods}
        case = prepare(track, self.rotate, self.seed, self.limits)
        for name, method in self.methods.items():
            _evaluate(name, method, case, ledgers)
        return _OfTrack(track.name, ledgers)


def whole_track_name(name: str, method: Method) -> str:
    """Under which row a method's completions of whole tracks stand."""
    alone = isinstance(method, Completer)
    return f"{name}, whole track" if alone else name


def _evaluate(name: str, method: Method, case: Case, ledgers: dict[str, _Ledger]) -> None:
    ledger = ledgers[name]
    ledger.skipped.extend(case.skipped)
    if not case.scans:
        return
    if isinstance(method, Completer):
        _score_scans(method, case, ledger)
    if isinstance(method, CanonicalCompleter):
        _score_canonical(method, case, ledger)
    if isinstance(method, TrackCompleter):
        _score_whole(method, case, ledgers.setdefault(whole_track_name(name, method), _Ledger()))
    if isinstance(method, Registrar):
        _score_registration(method, case, ledger)


def _score_scans(method: Completer, case: Case, ledger: _Ledger) -> None:
    if case.truth is None or case.T_sensor_object is None:
        _skip_scans(case, ledger)
        return
    for i, answer in enumerate(complete_scans(method, case)):
        _score_completion(answer, case, case.truth, case.T_sensor_object[i], i, ledger)


def _skip_scans(case: Case, ledger: _Ledger) -> None:
    for i in range(len(case.scans)):
        ledger.skip(case, i, _no_truth(case))


def _no_truth(case: Case) -> str:
    """A shape alone does not help: where it lies in a scan, the true pose says."""
    return f"completion: no true {'poses' if case.T_sensor_object is None else 'shape'}"


def _score_canonical(method: CanonicalCompleter, case: Case, ledger: _Ledger) -> None:
    if case.truth is None:
        _skip_scans(case, ledger)
        return
    found = _of_each(case, lambda part: method.complete_canonical(part.inputs(), part.sensor))
    for i, points in enumerate(found):
        answer = None if points is None else Spoken(points)
        _score_completion(answer, case, case.truth, SE3.identity(), i, ledger)


class Spoken(NamedTuple):
    """The answer of a method that says nothing but a shape."""

    points: Points
    confidence: float | None = None
    box: Box | None = None
    p_pose: float | None = None
    p_box: float | None = None


def complete_scans(method: Completer, case: Case) -> Sequence[Answer | None]:
    """One answer a scan, in that scan's frame; None where the method refused it."""
    if case.rays and isinstance(method, SightedCompleter):
        return _of_each(
            case, lambda part: method.complete_sighted(part.inputs(), part.sensor, part.rays)
        )
    if isinstance(method, BatchCompleter):
        return _of_each(case, lambda part: method.complete_many(part.inputs(), part.sensor))
    return [_spoken(method.complete, scan, case) for scan in case.inputs()]


def _of_each(case: Case, ask: Callable[[Case], Iterable[Found]]) -> Sequence[Found | None]:
    """What a method says of each scan; None of those that it refuses."""
    kept, answer = taken(case, lambda part: list(ask(part)))
    found: list[Found | None] = [None] * len(case.scans)
    for i, one in zip(kept, answer or (), strict=True):
        found[i] = one
    return found


def _spoken(complete: Callable[[Any, Sensor], Points], given: Any, case: Case) -> Spoken | None:
    try:
        return Spoken(complete(given, case.sensor))
    except BadInputError:
        return None


def _score_whole(method: TrackCompleter, case: Case, ledger: _Ledger) -> None:
    if case.truth is None or case.T_sensor_object is None:
        ledger.skip(case, case.middle, _no_truth(case))
        return
    answer = _spoken(method.complete_track, case.inputs(), case)
    T_sensor_object = case.T_sensor_object[case.middle]
    every = len(case.scans)
    _score_completion(answer, case, case.truth, T_sensor_object, case.middle, ledger, scans=every)


def _score_completion(
    answer: Answer | None,
    case: Case,
    truth: Truth,
    T_sensor_object: SE3,
    i: int,
    ledger: _Ledger,
    *,
    scans: int = 1,
) -> None:
    if answer is None:
        ledger.skip(case, i, f"completion: {REFUSED}")
        return
    predicted = np.asarray(answer.points, dtype=np.float32)
    if len(predicted) == 0 or not np.isfinite(predicted).all():
        ledger.skip(case, i, f"completion: {NOT_FINITE}")
        return
    if predicted.ndim != 2 or predicted.shape[1] != 3:
        raise BadInputError(
            f"{case.name}: the method answers an array {predicted.shape}; it must give (m, 3)."
        )
    local = T_sensor_object.inverse().apply_numpy(predicted)
    partial = None if truth.partial is None else completion_error(local, truth.partial)
    floor = distance_floor(truth.area, len(local)) + distance_floor(truth.area, len(truth.shape))
    ledger.completions.append(
        CompletionScore(
            track=case.name,
            scan=case.scan_names[i],
            error=completion_error(local, truth.shape),
            error_partial=partial,
            truth=truth.kind,
            points=len(local),
            truth_points=len(truth.shape),
            cd_floor=floor,
            partial_points=None if truth.partial is None else len(truth.partial),
            confidence=answer.confidence,
            box=None if answer.box is None else box_score(answer.box, truth.box, T_sensor_object),
            p_pose=answer.p_pose,
            p_box=answer.p_box,
            scans=scans,
        )
    )


def _score_registration(method: Registrar, case: Case, ledger: _Ledger) -> None:
    others = [i for i in range(len(case.scans)) if i != case.middle]
    if case.T_sensor_object is None or not others:
        reason = "no true poses" if others else ONE_SCAN
        for i in range(len(case.scans)):
            ledger.skip(case, i, f"registration: {reason}")
        return
    kept, middle, T_middle_scan = _registered(method, case)
    for i in range(len(case.scans)):
        if i not in kept and i != middle:
            ledger.skip(case, i, f"registration: {REFUSED}")
    # The middle scan against itself is no test and is not counted.
    others = [i for i in kept if i != middle]
    if T_middle_scan is None or not others:
        return
    error = registration_error(
        T_middle_scan[torch.tensor([kept.index(i) for i in others])],
        case.T_sensor_object[torch.tensor(others)],
        case.T_sensor_object[middle],
    )
    names = [part.name for part in fields(error)]
    columns = torch.stack([getattr(error, name) for name in names], dim=1).tolist()
    for i, values in zip(others, columns, strict=True):
        if not np.isfinite(values).all():
            ledger.skip(case, i, f"registration: {NOT_FINITE}")
            continue
        figures = dict(zip(names, values))
        ledger.registrations.append(
            RegistrationScore(track=case.name, scan=case.scan_names[i], **figures)
        )


def _registered(method: Registrar, case: Case) -> tuple[Sequence[int], int, SE3 | None]:
    """The scans that a method takes, the one that it registers them to, and `T_middle_scan`.

    That is the middle scan, or where this is refused the middle one of those that are taken.
    """
    kept, T = taken(case, lambda part: method.register_track(part.inputs(), part.sensor))
    if T is None:
        return kept, case.middle, None
    T, own = T.to(torch.float64), kept[len(kept) // 2]
    if case.middle not in kept or case.middle == own:
        return kept, own, T
    return kept, case.middle, T[kept.index(case.middle)].inverse() @ T
