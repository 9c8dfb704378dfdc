# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans that a model completes as they are looked at."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, runtime_checkable

from wildshape.inference.folders.complete_folder import describe
from wildshape.records import Completion, Sensor, Track
from wildshape.report.results import chances_of, doubt_of
from wildshape.report.viewer.sources import CompletedScan, Source


@runtime_checkable
class Completes(Protocol):
    """What is asked of a model."""

    def complete_many(
        self, scans: Sequence[object], sensor: Sensor | None, *, rays: Sequence[object] = ()
    ) -> Iterator[Completion]:
        """Each scan completed on its own, in order."""
        ...


def from_model(
    title: str,
    labels: Sequence[str],
    track: Callable[[int], Track],
    model: Callable[[], Completes],
    note: str = "",
) -> Source:
    """Scans, and a model that completes them when they are shown.

    `model` is called once, when the first scan is to be completed.
    """
    loaded: list[Completes] = []

    def make(_: int, shown: Track, first: int) -> Iterator[tuple[int, CompletedScan]]:
        if not loaded:
            loaded.append(model())
        yield from _complete(loaded[0], shown, first)

    return Source(title, tuple(labels), track, make, note)


def _complete(model: Completes, track: Track, first: int) -> Iterator[tuple[int, CompletedScan]]:
    """The scan that is looked at, then all others."""
    order = [first, *(i for i in range(len(track.scans)) if i != first)]
    for part in (order[:1], order[1:]):
        rays = [track.rays[i] for i in part] if track.rays else ()
        done = model.complete_many([track.scans[i] for i in part], track.sensor, rays=rays)
        for number, completion in zip(part, done):
            yield number, _completed(completion)


def _completed(done: Completion) -> CompletedScan:
    said = describe("", done)
    return CompletedScan(
        points=done.points,
        box=done.box,
        pose=done.pose,
        confidence=done.confidence,
        warning=doubt_of(said),
        seconds=done.seconds,
        chances=chances_of([said]),
    )
