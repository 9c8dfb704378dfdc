# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How a scan was taken, in `track.json` and in the packed store (docs/formats.md)."""

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

from wildshape.errors import BadInputError
from wildshape.records import Intrinsics, Sensor

_MOST_PIXELS = 1e9


def sensor_from_json(raw: dict[str, Any], path: Path) -> Sensor:
    """The sensor described by the keys sensor, resolution_deg and intrinsics.

    Raises:
        BadInputError: a value makes no sense.
    """
    kind = raw.get("sensor", "camera" if raw.get("intrinsics") else "lidar")
    if kind not in ("lidar", "camera"):
        raise BadInputError(f"{path}: sensor {kind!r} is unknown; use 'lidar' or 'camera'.")
    try:
        steps, intrinsics = raw.get("resolution_deg"), raw.get("intrinsics")
        azimuth, elevation = (float(step) for step in steps or (1.0, 1.0))
        if not (0.0 < azimuth < 360.0 and 0.0 < elevation < 360.0):
            raise ValueError(f"steps {steps}, which are no angles in degrees")
        return Sensor(
            kind=kind,
            resolution_deg=(azimuth, elevation) if steps else None,
            intrinsics=_parse_intrinsics(intrinsics) if intrinsics else None,
        )
    except (TypeError, ValueError, KeyError, OverflowError) as error:
        raise BadInputError(
            f"{path}: expected resolution_deg [azimuth, elevation] or intrinsics "
            f"{{fx, fy, cx, cy, width, height}}, found {type(error).__name__}: {error}."
        ) from error


def _parse_intrinsics(raw: dict[str, Any]) -> Intrinsics:
    numbers = {key: float(raw[key]) for key in ("fx", "fy", "cx", "cy")}
    sizes = {key: int(raw[key]) for key in ("width", "height")}
    lengths = (numbers["fx"], numbers["fy"], *sizes.values())
    if (
        not all(map(math.isfinite, numbers.values()))
        or min(lengths) <= 0
        or max(lengths) > _MOST_PIXELS
    ):
        raise ValueError(f"{numbers | sizes}, which is no camera")
    return Intrinsics(**numbers, width=sizes["width"], height=sizes["height"])


def sensor_to_json(sensor: Sensor) -> dict[str, Any]:
    """The keys of track.json that describe a sensor; unknown ones are left out."""
    data: dict[str, Any] = {"sensor": sensor.kind}
    if sensor.resolution_deg is not None:
        data["resolution_deg"] = list(sensor.resolution_deg)
    if sensor.intrinsics is not None:
        data["intrinsics"] = asdict(sensor.intrinsics)
    return data
