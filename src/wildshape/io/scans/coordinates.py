# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How the numbers in a user's files are to be understood: their unit, and where the sensor was."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError

Unit = Literal["m", "cm", "mm"]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}

Place = tuple[float, float, float]

_COARSEST_M = 0.005
_FLOAT32_STEP = 2.0**-24  # half of what two neighbouring numbers of float32 differ by, relatively


@dataclass(frozen=True)
class Coordinates:
    """How files are to be read.

    Attributes:
        unit: of their numbers.
        origin: the sensor's position in the files' own frame and unit, for scans that were moved
            into a map; subtracted before anything is rounded to float32.
    """

    unit: Unit = "m"
    origin: Place = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.unit not in METRES:
            raise BadInputError(f"unit '{self.unit}' is unknown; use one of {', '.join(METRES)}.")

    @property
    def moved(self) -> bool:
        """Whether the files are not in their sensor's frame."""
        return any(self.origin)

    def in_unit(self, unit: Unit) -> "Coordinates":
        """The same in the unit that a file names, unless the user has said another than `m`."""
        return replace(self, unit=unit) if self.unit == "m" else self

    def agreeing(self, unit: Unit | None, path: Path) -> "Coordinates":
        """The same in the unit that a scan's own header names, which no other may contradict.

        Raises:
            BadInputError: the user or track.json has said another than `m`.
        """
        if unit is not None and self.unit not in ("m", unit):
            raise BadInputError(
                f"{path}: its header gives the coordinates in {unit}, but --unit or track.json says"
                f" {self.unit}; leave that away."
            )
        return replace(self, unit=unit or self.unit)

    def to_sensor(self, points: Float[np.ndarray, "n 3"], path: Path) -> Float[np.ndarray, "n 3"]:
        """Points of a file in its sensor's frame, metres, in the precision that they have.

        Raises:
            BadInputError: the file itself was rounded so coarsely that no origin can cure it.
        """
        if self == SENSOR_METRES:
            return points
        exact = points.astype(np.float64)
        if self.moved:
            self._check_precision(exact, path)
        return (exact - self.origin) * METRES[self.unit]

    def _check_precision(self, points: Float[np.ndarray, "n 3"], path: Path) -> None:
        """Refuse numbers so large that float32 steps over centimetres, if float32 held them."""
        finite = points[np.isfinite(points)]
        with np.errstate(over="ignore"):
            kept = np.array_equal(finite, finite.astype(np.float32))
        largest = float(np.abs(finite).max(initial=0.0))
        step = 2 * _FLOAT32_STEP * largest * METRES[self.unit]
        if kept and step > _COARSEST_M:
            raise BadInputError(
                f"{path}: holds coordinates of {largest:.4g} {self.unit} rounded to float32, to"
                f" {100 * step:.2g} cm; write it in float64, or subtract the sensor's position"
                " before writing it."
            )


SENSOR_METRES = Coordinates()
"""Files in their sensor's frame, in metres."""
