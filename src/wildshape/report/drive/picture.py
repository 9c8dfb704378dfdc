# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive from above as a picture: for paper, for browsers without WebGL, and for the README.

Drawn on a slate card of its own, it reads the same on light and dark pages.
"""

import io
import math
import re
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.drives.source import Drive
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle
from wildshape.drives.writing.playback.moments import PALETTE
from wildshape.geometry.sampling import thin
from wildshape.io.atomic import atomic_write
from wildshape.io.progress import literal
from wildshape.report.drive.scene import (
    NOBODY,
    DrawnScan,
    boxes_by_frame,
    drawn_scans,
    owners_of,
    placed,
)

_CARD, _TEXT, _SOFT = "#12171e", "#e9ecf0", "#a0a8b3"
_DPI, _WIDE_IN = 110, 14.0
_MARGIN_M, _BAR_M = 6.0, 10.0
_SCANS, _SHAPE_POINTS = 12, 2500
_NEAR_M, _ROW = 25.0, 0.15  # of the README's picture: a row of vehicles, of the width


def for_picture(scans: Sequence[DrawnScan]) -> Sequence[DrawnScan]:
    """Those of all scans whose points are drawn."""
    return scans[:: -(-len(scans) // _SCANS) or 1]


def picture_from_above(found: FinishedDrive, scans: Sequence[DrawnScan]) -> bytes:
    """A WebP of the whole drive: what stands, every vehicle where it was best seen, the ways."""
    low, high = _bounds(found)
    figure = _figure((high[1] - low[1]) / (high[0] - low[0]))
    _above(figure.add_axes((0, 0, 1, 1)), found, scans, (low, high))
    return _image(figure, ".webp")


def write_drive_picture(
    found: FinishedDrive, drive: Drive, path: Path, shown: Sequence[FoundVehicle]
) -> None:
    """What lies near the sensor's way, and below some vehicles: a scan and the completed shape.

    `path`: `.png` or `.webp`; `shown`: at most five vehicles.
    """
    low, high = _bounds(found, _NEAR_M)
    ratio = (high[1] - low[1]) / (high[0] - low[0])
    figure = _figure(ratio + _ROW)
    foot = _ROW / (ratio + _ROW)
    scans = drawn_scans(found, drive)
    _above(figure.add_axes((0, foot, 1, 1 - foot)), found, scans, (low, high))
    share = 1 / max(1, len(shown))
    for place, one in enumerate(shown):
        for half, completed in enumerate((False, True)):
            at = (share * (place + 0.06 + 0.44 * half), 0.0, 0.44 * share, foot)
            _vehicle(figure, at, found, drive, one, completed=completed)
        figure.text(
            share * (place + 0.5), 0.02, f"{_short(one)}: one scan, and completed", color=_TEXT,
            ha="center", fontsize=11,
        )  # fmt: skip
    with atomic_write(path) as file:
        file.write(_image(figure, path.suffix))


def _across(found: FinishedDrive) -> Float[np.ndarray, "2 2"]:
    """From the level world's x and y to the picture's: the sensor drives from left to right."""
    x, y, _ = (found.T_level_sensor.translation[-1] - found.T_level_sensor.translation[0]).tolist()
    yaw = math.atan2(y, x) if math.hypot(x, y) > _MARGIN_M else 0.0
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array(((c, s), (-s, c)))


def _bounds(found: FinishedDrive, near_m: float = math.inf) -> tuple[np.ndarray, np.ndarray]:
    """Of the sensor's way and of vehicles that come so near, in the picture, with a margin."""
    places = [found.T_level_sensor.translation.numpy()[:, :2]]
    near = (one for one in found.vehicles if one.nearest_m < near_m)
    places += [placed(found, one)[[one.frames.index(one.fullest)], :2] for one in near]
    every = np.concatenate(places) @ _across(found).T
    low, high = every.min(0) - _MARGIN_M, every.max(0) + _MARGIN_M
    short = np.maximum(0.32 * (high - low).max() - (high - low), 0) / 2
    return low - short, high + short


def _figure(ratio: float) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDE_IN, _WIDE_IN * ratio), facecolor=_CARD)
    FigureCanvasAgg(figure)
    return figure


def _image(figure: Any, suffix: str) -> bytes:
    from PIL import Image

    figure.set_dpi(_DPI)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # names in scripts that matplotlib's font lacks
        figure.canvas.draw()
    image = Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3])
    buffer = io.BytesIO()
    image.save(buffer, format=suffix[1:].upper(), quality=80, method=4)
    return buffer.getvalue()


def _above(
    axes: Any,
    found: FinishedDrive,
    scans: Sequence[DrawnScan],
    bounds: tuple[np.ndarray, np.ndarray],
) -> None:
    (left, foot), (right, top) = bounds
    axes.set_axis_off()
    axes.set(xlim=(left, right), ylim=(foot, top))
    axes.set_aspect("equal")
    _standing(axes, found, scans)
    for number, one in enumerate(found.vehicles):
        _from_above(axes, found, one, PALETTE[number % len(PALETTE)])
    way = found.T_level_sensor.translation.numpy()[:, :2] @ _across(found).T
    axes.plot(*way.T, color="white", linewidth=2, solid_capstyle="round", zorder=4)
    axes.plot(*way[-1], "o", color="white", markersize=6, zorder=4)
    _scale_bar(axes, bounds)


def _standing(axes: Any, found: FinishedDrive, scans: Sequence[DrawnScan]) -> None:
    """Points on no vehicle of some scans, brighter the higher."""
    for scan in for_picture(scans):
        T = found.T_level_sensor[scan.frame]
        points = T.apply_numpy(scan.points[scan.owners == NOBODY])
        height = points[:, 2] - float(T.translation[2]) + found.ground_m
        order = np.argsort(height)
        x, y = _across(found) @ points[order, :2].T
        colours = {"c": height[order], "cmap": _greys(), "vmin": 0, "vmax": 3}
        axes.scatter(x, y, **colours, s=1.3, linewidths=0, rasterized=True)


def _greys() -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("greys", ["#303b47", "#8090a0", "#d3dce3"])


def _from_above(axes: Any, found: FinishedDrive, one: FoundVehicle, colour: str) -> None:
    """Box, shape and name where it was seen best, and its way if it moves."""
    across, places = _across(found), placed(found, one)
    place = places[one.frames.index(one.fullest)]
    (x, y), yaw = across @ place[:2], place[3]
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array(((c, s), (-s, c))) @ across.T
    length, width, _ = one.size
    outline = np.array(
        ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1), (1.3, 0), (1, 1))
    ) * (length / 2, width / 2)
    shape = thin(found.shape(one), _SHAPE_POINTS)[:, :2]
    axes.scatter(*(shape @ turn + (x, y)).T, color=colour, s=0.7, linewidths=0, zorder=3)
    axes.plot(*(outline @ turn + (x, y)).T, color=colour, linewidth=1.4, zorder=5)
    axes.annotate(
        _short(one), (x, y), color=_TEXT, fontsize=10, ha="center", va="center", zorder=6,
        bbox={"facecolor": _CARD, "alpha": 0.65, "pad": 1.2, "linewidth": 0},
    )  # fmt: skip
    if one.moving:
        axes.plot(*across @ places[:, :2].T, color=colour, linewidth=1.5, alpha=0.8, zorder=2)


def _short(one: FoundVehicle) -> str:
    """Of a name that several tracks gave, as `0007+2`, the first."""
    return literal(re.sub(r"\+\d+$", "", one.name))


def _scale_bar(axes: Any, bounds: tuple[np.ndarray, np.ndarray]) -> None:
    x, y = bounds[0] + 0.02 * (bounds[1] - bounds[0]).max()
    axes.plot((x, x + _BAR_M), (y, y), color=_SOFT, linewidth=2, solid_capstyle="butt")
    axes.annotate(f"{_BAR_M:.0f} m", (x, y), xytext=(0, 4), textcoords="offset points", color=_SOFT)


def _vehicle(
    figure: Any,
    place: tuple[float, float, float, float],
    found: FinishedDrive,
    drive: Drive,
    one: FoundVehicle,
    *,
    completed: bool,
) -> None:
    """One panel: what its fullest scan saw of it, or its completed shape."""
    axes = figure.add_axes(place, projection="3d", computed_zorder=False)
    half = max(one.size) / 2
    axes.set(xlim=(-half, half), ylim=(-half, half), zlim=(-half, half))
    axes.set_box_aspect((1, 1, 1), zoom=1.55)
    axes.view_init(elev=20, azim=-62)
    axes.set_axis_off()
    axes.patch.set_alpha(0)
    number = found.vehicles.index(one)
    colour = PALETTE[number % len(PALETTE)] if completed else "#ffffff"
    points = thin(found.shape(one), 3500) if completed else _seen(found, drive, one)
    x, y, z = points.T
    axes.scatter(x, y, z, color=colour, s=3.0, linewidths=0, depthshade=completed, clip_on=False)


def _seen(found: FinishedDrive, drive: Drive, one: FoundVehicle) -> np.ndarray:
    """Its points of its fullest scan, in the frame of its box."""
    frame = one.fullest
    boxes = boxes_by_frame(found)[frame]
    number = found.vehicles.index(one)
    scan = drive.scan(frame)
    mine = scan[owners_of(scan, boxes) == number]
    T_level_box = found.placed(one)[one.frames.index(frame)]
    T_box_sensor = T_level_box.inverse() @ found.T_level_sensor[frame]
    return thin(T_box_sensor.apply_numpy(mine), 2500)
