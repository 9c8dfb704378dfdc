# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the viewer shows, and results on disk as its source; of a model: `live_completion.py`."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wildshape.datasets.tracks.truth import shape_partial, whole_shape
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Points, Sensor, Track, as_text
from wildshape.report.results import (
    OBJECTS,
    Inputs,
    TrackResult,
    box_of,
    chances_of,
    doubt_of,
    errors_of_scores,
    find,
    read_result,
)


@dataclass(frozen=True)
class CompletedScan:
    """What was made of one scan; everything in that scan's sensor frame, metres.

    Attributes:
        points: the completed shape; None where only the pose was asked for.
        pose: `T_sensor_canonical`.
        confidence: 0 to 1.
        chances: the probabilities that make it, by the words for them (`results.MEANING`).
        warning: why it is not to be trusted, or nothing.
        seconds: time spent on the scan.
    """

    points: Points | None = None
    box: Box | None = None
    pose: SE3 | None = None
    confidence: float | None = None
    warning: str = ""
    seconds: float | None = None
    chances: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Source:
    """Tracks and what is made of them, each read or computed when it is first shown.

    Attributes:
        title: where they come from, in a few words.
        labels: what the picker calls the tracks.
        track: reads one; raises BadInputError where it cannot be used.
        make: (number, track, scan to begin with) -> every scan's number and what was made of it.
        note: a sentence on what is shown, or nothing.
    """

    title: str
    labels: tuple[str, ...]
    track: Callable[[int], Track]
    make: Callable[[int, Track, int], Iterator[tuple[int, CompletedScan]]]
    note: str = ""


def true_shape(track: Track) -> Points | None:
    """`(g, 3)` in the object's frame: the track's shape, or what its true poses accumulate to."""
    if track.shape is not None or track.T_sensor_object is None:
        return whole_shape(track)
    return shape_partial(track)


def from_results(folder: Path, inputs: Path | None = None) -> Source:
    """What `complete` or `register` left in a folder, or in one track's folder.

    `inputs`: where the scans are now, if they have moved.

    Raises:
        BadInputError: nothing of the kind is there, or no scans at `inputs`.
    """
    folders = [path.parent for path in find(folder, OBJECTS)]
    if not folders:
        raise BadInputError(f"{folder}: holds no objects.json; name the --out of complete.")
    names = [place.relative_to(folder).as_posix() for place in folders]
    labels = [as_text(folder.resolve().name if name == "." else name) for name in names]
    where, kept = Inputs(inputs), {}
    where.check(folders)

    def result(number: int) -> TrackResult:
        if number not in kept:
            kept.clear()
            kept[number] = read_result(folders[number], where)
        return kept[number]

    return Source(
        title=as_text(folder.resolve().name),
        labels=tuple(labels),
        track=lambda number: _track(result(number)),
        make=lambda number, track, first: _read(result(number), track, first),
    )


def worst_first(scores: Path, method: str) -> list[tuple[str, float]]:
    """Tracks and their mean CD of one method's row in scores.json, the worst first.

    Raises:
        BadInputError: the file is damaged.
    """
    cds = errors_of_scores(scores, method)["cd"]
    return sorted(((t, float(np.mean(v))) for t, v in cds.items()), key=lambda pair: -pair[1])


def _read(result: TrackResult, track: Track, first: int) -> Iterator[tuple[int, CompletedScan]]:
    poses = result.poses()
    lines = {scan: line for line, scan in enumerate(result.scans)}
    order = [first, *(i for i in range(len(track.scans)) if i != first)]
    for number in order:
        name = track.scan_names[number]
        entry, line = result.entry(name), lines.get(name)
        known = poses is not None and line is not None and line < len(poses)
        yield (
            number,
            CompletedScan(
                points=result.completed(name),
                box=box_of(entry),
                pose=poses[line] if poses is not None and line is not None and known else None,
                confidence=entry.get("confidence"),
                warning=doubt_of(entry),
                seconds=entry.get("seconds"),
                chances=chances_of([entry]),
            ),
        )


def _track(result: TrackResult) -> Track:
    """The scans that have a result; empty ones where the scans themselves cannot be read."""
    names = result.scans or tuple(result.completed_scans())
    if result.track is None:
        empty: tuple[Points, ...] = tuple(np.zeros((0, 3), np.float32) for _ in names)
        if not names:
            raise BadInputError(f"{result.folder}: neither its scans nor shapes can be read.")
        said = "its scans cannot be read by their names, or changed since; --inputs names them"
        sensor = Sensor(result.sensor)
        return Track(result.folder.name, empty, names, sensor=sensor, source=said)
    return result.track
