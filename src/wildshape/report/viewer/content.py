# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the viewer shows, as records; where it comes from is decided in `sources`."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from wildshape.datasets.tracks.truth import shape_partial
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Points, Track


@dataclass(frozen=True)
class CompletedScan:
    """What was made of one scan; everything in that scan's sensor frame, metres.

    Attributes:
        points: the completed shape; None where only the pose was asked for.
        box: around it.
        pose: `T_sensor_canonical`.
        confidence: 0 to 1.
        warning: why it is not to be trusted, or nothing.
        seconds: time spent on the scan.
    """

    points: Points | None = None
    box: Box | None = None
    pose: SE3 | None = None
    confidence: float | None = None
    warning: str = ""
    seconds: float | None = None


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
        return track.shape
    return shape_partial(track)
