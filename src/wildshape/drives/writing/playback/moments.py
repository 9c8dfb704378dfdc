# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is where in each frame of a finished drive, in the level world."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from wildshape.drives.source import Drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle
from wildshape.errors import BadInputError
from wildshape.geometry.sampling import thin
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

# Told apart on a dark ground, the first six by colour-blind readers, too (Okabe & Ito 2008).
PALETTE = (
    "#e69f00",
    "#56b4e9",
    "#2fc58f",
    "#f0e442",
    "#ff7a45",
    "#e48ac0",
    "#6f9bff",
    "#a6e05a",
    "#b99cff",
    "#ff8f8f",
)
SCAN_POINTS, SHAPE_POINTS = 20_000, 1500  # at most, of a scan and of a complete shape


@dataclass(frozen=True)
class Present:
    """A vehicle in one frame.

    Attributes:
        colour: red, green, blue, 0 to 255.
        T_level_box: where its box is.
        points: of the scan that belong to it.
        speed: over the ground, m/s; None where no times are known.
    """

    vehicle: FoundVehicle
    colour: tuple[int, int, int]
    T_level_box: SE3
    points: int
    speed: float | None


@dataclass(frozen=True)
class Moment:
    """One frame.

    Attributes:
        frame: counted from 0.
        seconds: since the first.
        T_level_sensor: where the sensor is.
        scan: thinned, sensor frame, metres; empty where the recording cannot be read.
        present: the vehicles in it.
    """

    frame: int
    seconds: float
    T_level_sensor: SE3
    scan: Points
    present: tuple[Present, ...]


def moments(found: FinishedDrive) -> Iterator[Moment]:
    """All frames, their scans read one by one."""
    drive = readable_source(found)
    there: dict[int, list[tuple[int, int]]] = {}  # number of the vehicle, and which of its frames
    for number, one in enumerate(found.vehicles):
        for row, frame in enumerate(one.frames):
            there.setdefault(frame, []).append((number, row))
    places = [found.placed(one) for one in found.vehicles]
    speeds = [found.speeds(one) for one in found.vehicles]

    def present(number: int, row: int) -> Present:
        one, known = found.vehicles[number], speeds[number]
        speed = None if known is None else known[row]
        return Present(one, colour_of(number), places[number][row], one.points[row], speed)

    none = np.empty((0, 3), np.float32)
    for frame, seconds in enumerate(found.seconds):
        yield Moment(
            frame,
            seconds,
            found.T_level_sensor[frame],
            none if drive is None else thin(drive.scan(frame), SCAN_POINTS),
            tuple(present(*at) for at in there.get(frame, ())),
        )


def readable_source(found: FinishedDrive) -> Drive | None:
    """The recording; None where it has gone."""
    try:
        return found.open_source()
    except BadInputError:
        return None


def colour_of(number: int) -> tuple[int, int, int]:
    """Of a vehicle, by its number."""
    text = PALETTE[number % len(PALETTE)]
    red, green, blue = (int(text[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
