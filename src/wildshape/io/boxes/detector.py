# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A box that somebody else's detector found, whichever format it came in."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from wildshape.records import Box, as_text

MOST_TURN = 4 * math.pi
"""Radians; what is more than two turns counts degrees."""

_SHORTEST = 0.1  # a quaternion of any other length is normalised


@dataclass(frozen=True)
class DetectorBox:
    """One object in one scan.

    Attributes:
        scan: the scan's name or its number, as the file has it; an int counts scans from 0.
        category: as the file has it, for example `Car`; empty if unknown.
        track: which object it is, if known.
        score: the detector's own, if it gives one.
    """

    scan: str | int
    category: str
    track: str | None
    box: Box
    score: float | None = None

    def __post_init__(self) -> None:
        """JSON may hold halves of characters, which no file can (`as_text`).

        Raises:
            ValueError: the score is not finite.
        """
        if self.score is not None and not math.isfinite(self.score):
            raise ValueError(f"a box whose score is not finite: {self.score}")
        for name in ("scan", "category", "track"):
            if isinstance(given := getattr(self, name), str):
                object.__setattr__(self, name, as_text(given))


def checked(box: Box) -> Box:
    """The box itself.

    Raises:
        ValueError: a number is not finite, a size is not positive, or a quaternion tells no turn.
    """
    numbers = (*box.centre, *box.size, *box.quaternion_wxyz)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a box with a number that is not finite")
    if min(box.size) <= 0:
        raise ValueError(f"a box of size {box.size}")
    return check_turn(box)


def check_turn(box: Box) -> Box:
    """The box itself.

    Raises:
        ValueError: its quaternion is next to 0.
    """
    if math.hypot(*box.quaternion_wxyz) < _SHORTEST:
        raise ValueError(f"a box turned by {box.quaternion_wxyz}, which is next to 0")
    return box


def check_radians(turn: float) -> float:
    """The turn itself.

    Raises:
        ValueError: it counts degrees.
    """
    if abs(turn) > MOST_TURN:
        raise ValueError(f"a box turned by {turn:g}, expected radians")
    return turn


def upright_box(centre: Sequence[float], size: Sequence[float], yaw: float) -> Box:
    """A box that does not lean.

    Metres; `size` is length, width, height; `yaw` about z, counter-clockwise from x, radians.

    Raises:
        ValueError: not three numbers each, no box, or a turn in degrees.
    """
    x, y, z = map(float, centre)
    length, width, height = map(float, size)
    half = check_radians(float(yaw)) / 2
    return checked(
        Box((x, y, z), (length, width, height), (math.cos(half), 0.0, 0.0, math.sin(half)))
    )
