# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What evaluation asks of a method. Methods offer any of these and do not import this file.

None of them is handed anything but points, how they were taken, and, where it can take them, the
rays of the frame that missed the object (METHOD 8).
"""

from collections.abc import Iterable, Sequence
from typing import Protocol, runtime_checkable

from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Box, Points, Sensor, SightLines


@runtime_checkable
class Completer(Protocol):
    """Completes one scan on its own."""

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """The complete shape `(m, 3)` in the frame of `points` `(n, 3)`, metres."""
        ...


@runtime_checkable
class Answer(Protocol):
    """What a method says of a scan, as `records.Completion` does; None where it says nothing."""

    @property
    def points(self) -> Points:
        """The complete shape `(m, 3)` in the scan's frame, metres."""
        ...

    @property
    def confidence(self) -> float | None:
        """How far the method trusts it, 0 to 1."""
        ...

    @property
    def box(self) -> Box | None:
        """Of the object, in the scan's frame."""
        ...

    @property
    def p_pose(self) -> float | None:
        """Probability that the heading is within 10 degrees of the truth."""
        ...

    @property
    def p_box(self) -> float | None:
        """Probability that the box and the true one overlap by 0.7 in bird's eye view."""
        ...


@runtime_checkable
class BatchCompleter(Completer, Protocol):
    """Completes several scans, each on its own, faster together, and may say more of each."""

    def complete_many(self, scans: list[Points], sensor: Sensor) -> Iterable[Answer]:
        """`complete` of each scan, in order."""
        ...


@runtime_checkable
class SightedCompleter(Completer, Protocol):
    """Knows what to do with the rays that passed an object by."""

    def complete_sighted(
        self, scans: list[Points], sensor: Sensor, rays: Sequence[SightLines | None]
    ) -> Iterable[Answer]:
        """`complete` of each scan, in order, with the rays of its frame."""
        ...


@runtime_checkable
class TrackCompleter(Protocol):
    """Completes an object from all scans of its track together."""

    def complete_track(self, scans: list[Points], sensor: Sensor) -> Points:
        """The shape `(m, 3)` in the frame of the middle scan, `scans[len(scans) // 2]`."""
        ...


@runtime_checkable
class CanonicalCompleter(Protocol):
    """Completes scans in the frame of their object, and does not find where that lies.

    What does so was told that frame in training, or by the truth of other objects: bounds, which no
    user can have.
    """

    def complete_canonical(self, scans: list[Points], sensor: Sensor) -> Iterable[Points]:
        """The complete shape `(m, 3)` of each scan, object frame, metres."""
        ...


@runtime_checkable
class Described(Protocol):
    """Says what it is, for the foot of a table."""

    @property
    def about(self) -> str:
        """Method, engine and settings in a line."""
        ...


@runtime_checkable
class Registrar(Protocol):
    """Finds how the object moved."""

    def register_track(self, scans: list[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan: takes each scan to the frame of the middle scan."""
        ...


Method = Completer | TrackCompleter | Registrar | CanonicalCompleter
