# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Why a completion is not to be trusted: short names for machines (docs/formats.md).

Asked of the scan: `other_sensor` (a camera's scan for weights of LiDARs, or the reverse),
`too_large_for_model` (the bounding box's diagonal is above the largest trained on),
`too_small_for_model` (below half of the smallest trained on: a scan may show a part of an object),
`few_points` (fewer than 32), `sensor_inside` (the points lie on all sides of the origin). Asked of
the result: `poor_fit` (the label-free cost is above 1.5 times the 90th percentile of scans held out
in training), `low_confidence` (below 0.1).
"""

from wildshape.geometry.projection.line_of_sight import surrounded
from wildshape.inference.prepare import MIN_POINTS, extent
from wildshape.method.checkpoint import ModelSettings
from wildshape.records import Completion, Points, Sensor

FEW_POINTS = 2 * MIN_POINTS
"""A scan of fewer points says little: what is accepted at least, twice."""

POOR_FIT = 1.5
"""Times the 90th percentile of the held-out label-free cost."""

LOW_CONFIDENCE = 0.1
"""One chance in ten that the completion is as good as the median of those calibrated on."""


def reasons_of_scan(
    scan: Points, sensor: Sensor | None, settings: ModelSettings
) -> tuple[str, ...]:
    """What speaks against the scan itself, a line a reason.

    Args:
        scan: sensor frame, metres.
        sensor: how it was taken, if known.
        settings: of the weights.
    """
    low, high = settings.extent_m
    size = extent(scan)
    holds = {
        "other_sensor": sensor is not None and sensor.kind != settings.sensor,
        "too_large_for_model": size > high,
        "too_small_for_model": size < low / 2,
        "few_points": len(scan) < FEW_POINTS,
        "sensor_inside": surrounded(scan),
    }
    return tuple(reason for reason, held in holds.items() if held)


def reasons_of_result(cost: float, confidence: float, settings: ModelSettings) -> tuple[str, ...]:
    """What speaks against what came out, a line a reason.

    Args:
        cost: label-free, metres.
        confidence: 0 to 1.
        settings: of the weights.
    """
    holds = {
        "poor_fit": cost > POOR_FIT * settings.cost_m[1],
        "low_confidence": confidence < LOW_CONFIDENCE,
    }
    return tuple(reason for reason, held in holds.items() if held)


def judged_again(
    done: Completion, cost: float, confidence: float, settings: ModelSettings
) -> tuple[str, ...]:
    """The reasons of a completion whose cost and confidence have changed."""
    before = reasons_of_result(done.cost, done.confidence, settings)
    of_scan = (reason for reason in done.reasons if reason not in before)
    return (*of_scan, *reasons_of_result(cost, confidence, settings))


def warning_of(scan: Points, sensor: Sensor | None, settings: ModelSettings) -> str:
    """One sentence where the model was not made for such a scan, else nothing."""
    if sensor is not None and sensor.kind != settings.sensor:
        return f"a {sensor.kind} scan, but the model was trained on {settings.sensor} scans"
    if surrounded(scan):
        return (
            "its points lie on all sides of the origin, where no sensor can have stood: moved to"
            " its own centre? hand it in as the sensor saw it"
        )
    low, high = settings.extent_m
    size = extent(scan)
    if size < low / 2 or size > 1.5 * high:
        return (
            f"extent {size:.3g} m lies outside the {low:.3g} to {high:.3g} m trained on;"
            " check the unit, or train on such objects"
        )
    return ""
