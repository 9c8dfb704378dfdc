# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Completions whose heading, box and kind are known: what probabilities are fitted to and held by.

Objects of simulated streets are cut out and linked as `wildshape drive` does. An object most of
whose points lie in a vehicle's box is one; one of few such points is none.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from experiments.labelled_boxes import upright, upright_labels
from jaxtyping import Float

from wildshape.drives.completing.cluster_association import in_box
from wildshape.drives.completing.completion import fullest_of_parts
from wildshape.drives.completing.level_frame import level_poses
from wildshape.drives.config import DriveConfig
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.tracking.mounting import find_mounting
from wildshape.drives.tracking.segmentation import Cutter
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.tracks import linked_clusters
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.evaluation.calibration import HEADING_DEG, LEAST_BEV
from wildshape.evaluation.drives.labels import LabelledFrame, read_labels
from wildshape.evaluation.drives.overlap import UprightBox, overlaps
from wildshape.inference.predictor import Predictor
from wildshape.method.trust import ScanFeatures, TrackFeatures
from wildshape.records import Completion, Points, Track

_SCANS, _TICKS, _OBJECTS, _ALIKE = 6, 4, 60, 3
_IS, _IS_NOT, _AROUND_M = 0.7, 0.3, 0.1
_NONE, _UNCLEAR = 0.0, math.nan


class Known(NamedTuple):
    """Completions with their truth, a row each; NaN where it is unclear or there is none.

    Attributes:
        features: `ScanFeatures` or `TrackFeatures`.
        turn: of the heading from the true one, degrees.
        box: whether the box is.
        kind: whether it is a vehicle.
        number: of the object.
        points: of the scan.
    """

    features: Float[np.ndarray, "n f"]
    turn: Float[np.ndarray, "n"]
    box: Float[np.ndarray, "n"]
    kind: Float[np.ndarray, "n"]
    number: Float[np.ndarray, "n"]
    points: Float[np.ndarray, "n"]

    @property
    def pose(self) -> Float[np.ndarray, "n"]:
        """Whether the heading is right. Which end of the canonical frame is the front, most say."""
        ends = [turn <= HEADING_DEG for turn in (self.turn, 180 - self.turn)]
        return np.where(np.isnan(self.turn), math.nan, max(ends, key=np.sum))

    @classmethod
    def joined(cls, parts: "Sequence[Known]") -> "Known":
        """All of several, their objects numbered through."""
        starts = np.cumsum([0, *(part.number.max(initial=-1) + 1 for part in parts)])
        moved = [part._replace(number=part.number + at) for part, at in zip(parts, starts)]
        return cls(*(np.concatenate(columns) for columns in zip(*moved)))


class Both(NamedTuple):
    """The same scans completed alone, and as a track; and tracks of which all views are alike."""

    scan: Known
    track: Known
    alike: Known


class _Case(NamedTuple):
    """An object's scans, the label of each if it is a vehicle, and whether it is one.

    `alike`: they were taken one after another, from nearly the same place.
    """

    scans: list[Points]
    labels: list[UprightBox | None]
    kind: float
    rays: tuple = ()
    alike: bool = False


def of_street(predictor: Predictor, drive: Path, cuts: Path, seed: int) -> Both:
    """The objects of a simulated street, most of them, each in some of its scans.

    Args:
        predictor: completes.
        drive: as `wildshape simulate --drive` writes it.
        cuts: folder for the clusters of its scans.
        seed: of the choice.
    """
    return _completed(predictor, _objects(drive, cuts, seed))


def of_tracks(predictor: Predictor, tracks: Sequence[Track], rays: bool) -> Both:
    """Tracks of labelled vehicles, with the rays of their frames or without."""
    cases = []
    for track in tracks:
        labels: list[UprightBox | None] = list(upright_labels(track))
        known = track.rays if rays else ()
        cases.append(_Case(list(track.scans), labels, _UNCLEAR, known))
    return _completed(predictor, cases)


def _objects(folder: Path, cuts: Path, seed: int) -> Iterator[_Case]:
    objects, labels = _linked(folder / "velodyne" / "0000", cuts), read_labels(folder).frames
    vehicles, others = [], []
    for one in objects:
        parts = min(_SCANS, (one.frames[-1] - one.frames[0]) // _TICKS + 1)
        case = _case(fullest_of_parts(one, parts), cuts, labels)
        if not math.isnan(case.kind):
            (vehicles if case.kind else others).append((one, case))
    rng = np.random.default_rng(seed)
    for found in (vehicles, others):
        for i in rng.permutation(len(found))[:_OBJECTS]:
            one, case = found[i]
            yield case
            yield from _alike(one, cuts, labels, rng)


def _alike(
    one: Sightings, cuts: Path, labels: Sequence[LabelledFrame], rng: np.random.Generator
) -> Iterator[_Case]:
    """Some scans of an object that follow each other, if it was seen so often."""
    later = len(one.frames) - _ALIKE
    if later < 0:
        return
    start = int(rng.integers(later + 1))
    case = _case(one.part(list(range(start, start + _ALIKE))), cuts, labels)
    if not math.isnan(case.kind):
        yield case._replace(alike=True)


def _linked(scans: Path, cuts: Path) -> list[Sightings]:
    config, drive = DriveConfig(), open_drive(scans)
    mounting = find_mounting(drive, config.mounting)
    T_world_sensor = find_trajectory(drive, mounting, config).T_world_sensor
    cutter = Cutter(drive.moved_by(T_world_sensor), mounting, cuts, config)
    for frame in cutter.missing():
        cutter(frame)
    T_level_sensor = level_poses(T_world_sensor, mounting)
    return linked_clusters(cuts, T_level_sensor, drive.ticks, config.tracks)


def _case(seen: Sightings, cuts: Path, labels: Sequence[LabelledFrame]) -> _Case:
    """An object by the labels that most of its points lie in."""
    clouds = seen.clouds(cuts)
    found = [_label(cloud, labels[frame]) for cloud, frame in zip(clouds, seen.frames)]
    share = float(np.average([part for part, _ in found], weights=seen.points))
    kind = float(share >= _IS) if share >= _IS or share < _IS_NOT else _UNCLEAR
    return _Case(clouds, [box if part >= _IS else None for part, box in found], kind)


def _label(points: Points, frame: LabelledFrame) -> tuple[float, UprightBox | None]:
    """The vehicle in whose box most of the points lie, and their share."""
    best: tuple[float, UprightBox | None] = (_NONE, None)
    for label in frame.labels:
        box = label.box
        if label.vehicle:
            place = np.array((box.x, box.y, box.z, box.yaw))
            size = (box.length, box.width, box.height)
            share = float(in_box(points, place, size, _AROUND_M).mean())
            best = max(best, (share, box), key=lambda one: one[0])
    return best


def _completed(predictor: Predictor, cases: Iterable[_Case]) -> Both:
    cases = list(cases)
    scans = [scan for case in cases for scan in case.scans]
    rays = [one for case in cases for one in case.rays or (None,) * len(case.scans)]
    each = predictor.complete_many(scans, rays=rays)
    rows: tuple[list, list, list] = ([], [], [])
    for number, case in enumerate(cases):
        alone = list(islice(each, len(case.scans)))
        if not case.alike:
            rows[0].extend(_rows(alone, case, number))
        if len(alone) > 1:
            together = predictor.put_together(alone, case.scans, case.rays)
            rows[2 if case.alike else 1].extend(_rows(together, case, number))
    widths = (ScanFeatures, TrackFeatures, TrackFeatures)
    return Both(*(_known(part, len(width._fields)) for part, width in zip(rows, widths)))


def _rows(done: Iterable[Completion], case: _Case, number: int) -> Iterator[tuple]:
    for one, label, scan in zip(done, case.labels, case.scans):
        yield one.evidence, *_truth(one, label), case.kind, number, len(scan)


def _known(rows: list[tuple], width: int) -> Known:
    if not rows:
        return Known(np.empty((0, width)), *np.empty((len(Known._fields) - 1, 0)))
    return Known(*map(np.array, zip(*rows)))


def _truth(done: Completion, label: UprightBox | None) -> tuple[float, float]:
    """How far the heading is off, degrees, and whether the box is right; NaN without a label."""
    if label is None:
        return math.nan, math.nan
    box = upright(done.box)
    turn = abs((box.yaw - label.yaw + math.pi) % (2 * math.pi) - math.pi)
    shared = float(overlaps([box], [label]).bev[0, 0])
    return math.degrees(turn), float(shared >= LEAST_BEV)
