# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When the points of a turn were taken, whatever unit and clock their field has.

Drivers agree on neither: Ouster's `t` and Livox's `offset_time` are nanoseconds since the scan's
stamp, Velodyne's `time` seconds since it, Hesai's and RoboSense's `timestamp` seconds of the day's
clock.
"""

import numpy as np
from jaxtyping import Float, Num

TIME_FIELDS = ("t", "time", "timestamp", "offset_time", "time_offset", "time_stamp", "gps_time")
"""Names of the fields that hold it, the likeliest first."""

LIKE_TIMES = (
    *("ts", "stamp", "dt", "delta_t", "Time", "Timestamp", "GpsTime", "GPSTime"),
    *("time_ns", "time_us", "timestamp_ns", "timestamp_us", "t_ns", "t_us"),
    # CloudCompare puts this before the name of every field of a PLY.
    *(f"scalar_{name}" for name in (*TIME_FIELDS, "Time", "Timestamp", "GpsTime", "GPSTime")),
)
"""Names under which times may stand, too, but which are not read."""

_UNITS = (1.0, 1e-3, 1e-6, 1e-9)
_SHORTEST_TURN_S, _LONGEST_TURN_S = 0.005, 0.5
_HOUR_S = 3600.0
_FEWEST = 100


def seconds_since(
    values: Num[np.ndarray, "n"], scan_time: float | None
) -> Float[np.ndarray, "n"] | None:
    """Seconds since the scan's time; None where the values tell of no turn.

    The unit is the one in which a turn lasts 5 ms to 0.5 s; shares of a turn have none. Values near
    0 are counted from the scan's time, values near that time are on its clock; of another clock,
    the first is the scan's time.

    Args:
        values: of each point, as recorded.
        scan_time: seconds, if known.
    """
    if len(values) < _FEWEST:
        return None
    unit = _unit_of(values)
    if unit is None:
        values = _past_the_hour(values)
        unit = _unit_of(values)
    if unit is None:
        return None
    first = values.min()
    if values.dtype.kind == "i":  # steps between them may be beyond their type
        values = values.astype(np.int64)
    return (values - first) * unit + _first_seconds(float(first) * unit, scan_time)


def _past_the_hour(values: Num[np.ndarray, "n"]) -> Num[np.ndarray, "n"]:
    """Times that go on where a clock that counts within the hour began anew amid a turn."""
    hours = (round(_HOUR_S / unit) for unit in _UNITS)
    hour = next((hour for hour in hours if hour / 2 < values.max() <= hour), None)
    if hour is None or values.min() < 0:
        return values
    early = np.where(values < hour / 2, hour, 0)
    return values.astype(np.result_type(values, np.int64)) + early


def _unit_of(values: Num[np.ndarray, "n"]) -> float | None:
    """Seconds in one of the values of a turn; None where they tell of none."""
    span = float(values.max()) - float(values.min())
    return next((u for u in _UNITS if _SHORTEST_TURN_S <= span * u <= _LONGEST_TURN_S), None)


def unusable_told(values: Num[np.ndarray, "n"] | None, like: str = "") -> str:
    """Why the points of a scan have no times, if they have a field of them.

    Args:
        values: of a field of `TIME_FIELDS` that tells of no turn; None: there is no such field.
        like: a field of `LIKE_TIMES` that there is.
    """
    if values is not None and len(values):
        low, high = float(values.min()), float(values.max())
        return f"times of points cannot be used: from {low:.10g} to {high:.10g} is no turn"
    return f"the field {like} is not read as times of points: name it `time`" if like else ""


def _first_seconds(first: float, scan_time: float | None) -> float:
    """When the first point was taken, since the scan's time; a clock may have begun just now."""
    told = (first,) if scan_time is None else (first, first - scan_time)
    nearest = min(told, key=abs)
    return nearest if abs(nearest) <= _LONGEST_TURN_S else 0.0
