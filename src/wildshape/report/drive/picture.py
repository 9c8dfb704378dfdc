# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive from above as a picture: for paper, for browsers without WebGL, and for the README.

Drawn on a slate card of its own, it reads the same on light and dark pages.
"""

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from wildshape.drives.finished import FinishedDrive, FoundVehicle
from wildshape.drives.playback.moments import PALETTE
from wildshape.drives.source import Drive
from wildshape.io.atomic import atomic_write
from wildshape.report.drive.scene import (
    NOBODY,
    DrawnScan,
    boxes_by_frame,
    drawn_scans,
    owners_of,
    placed,
)
from wildshape.report.scene import thin

_CARD, _TEXT, _SOFT = "#12171e", "#e9ecf0", "#a0a8b3"
_DPI, _WIDE_IN = 110, 14.0
_MARGIN_M, _BAR_M = 9.0, 10.0
_SCANS, _SHAPE_POINTS = 12, 2500


def picture_from_above(found: FinishedDrive, scans: Sequence[DrawnScan]) -> bytes:
    """A WebP of the whole drive: what stands, every vehicle where it was best seen, the ways."""
    low, high = _bounds(found)
    figure = _figure((high[1] - low[1]) / (high[0] - low[0]))
    _above(figure.add_axes((0, 0, 1, 1)), found, scans, (low, high))
    return _image(figure, ".webp")


def write_drive_picture(
    found: FinishedDrive, drive: Drive, path: Path, shown: Sequence[FoundVehicle]
) -> None:
    """The same with some vehicles below: a scan of each, and its completed shape.

    Args:
        found: the drive.
        drive: its scans.
        path: `.png` or `.webp`.
        shown: at most five vehicles.
    """
    low, high = _bounds(found)
    ratio = (high[1] - low[1]) / (high[0] - low[0])
    figure = _figure(ratio + 0.17)
    foot = 0.17 / (ratio + 0.17)
    scans = drawn_scans(found, drive)
    _above(figure.add_axes((0, foot, 1, 1 - foot)), found, scans, (low, high))
    for place, one in enumerate(shown):
        for half, completed in enumerate((False, True)):
            at = ((place + 0.5 * half) / len(shown), 0.0, 0.5 / len(shown), foot)
            _vehicle(figure, at, found, drive, one, completed=completed)
    with atomic_write(path) as file:
        file.write(_image(figure, path.suffix))


def _bounds(found: FinishedDrive) -> tuple[np.ndarray, np.ndarray]:
    """Of the ways of the sensor and the vehicles, on the ground, with a margin."""
    places = [found.T_level_sensor.translation.numpy()[:, :2]]
    places += [placed(found, one)[:, :2] for one in found.vehicles]
    every = np.concatenate(places)
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
    way = found.T_level_sensor.translation.numpy()
    axes.plot(*way[:, :2].T, color="white", linewidth=2, solid_capstyle="round", zorder=4)
    axes.plot(*way[-1, :2], "o", color="white", markersize=6, zorder=4)
    _scale_bar(axes, bounds)


def _standing(axes: Any, found: FinishedDrive, scans: Sequence[DrawnScan]) -> None:
    """Points on no vehicle of some scans, brighter the higher."""
    for scan in scans[:: -(-len(scans) // _SCANS) or 1]:
        T = found.T_level_sensor[scan.frame]
        points = T.apply_numpy(scan.points[scan.owners == NOBODY])
        height = points[:, 2] - float(T.translation[2]) + found.ground_m
        order = np.argsort(height)
        x, y, _ = points[order].T
        colours = {"c": height[order], "cmap": _greys(), "vmin": 0, "vmax": 3}
        axes.scatter(x, y, **colours, s=1.3, linewidths=0, rasterized=True)


def _greys() -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("greys", ["#303b47", "#8090a0", "#d3dce3"])


def _from_above(axes: Any, found: FinishedDrive, one: FoundVehicle, colour: str) -> None:
    """Box, shape and name where it was seen best, and its way if it moves."""
    places = placed(found, one)
    x, y, _, yaw = places[one.frames.index(one.fullest)]
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array(((c, s), (-s, c)))
    length, width, _ = one.size
    outline = np.array(
        ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1), (1.3, 0), (1, 1))
    ) * (length / 2, width / 2)
    shape = thin(found.shape(one), _SHAPE_POINTS)[:, :2]
    axes.scatter(*(shape @ turn + (x, y)).T, color=colour, s=0.7, linewidths=0, zorder=3)
    axes.plot(*(outline @ turn + (x, y)).T, color=colour, linewidth=1.4, zorder=5)
    axes.annotate(
        one.name, (x, y), color=_TEXT, fontsize=8, ha="center", va="center", zorder=6,
        bbox={"facecolor": _CARD, "alpha": 0.65, "pad": 1.2, "linewidth": 0},
    )  # fmt: skip
    if one.moving:
        axes.plot(*places[:, :2].T, color=colour, linewidth=1.5, alpha=0.8, zorder=2)


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
    axes.set_box_aspect((1, 1, 1), zoom=2.1)
    axes.view_init(elev=20, azim=-62)
    axes.set_axis_off()
    axes.patch.set_alpha(0)
    number = found.vehicles.index(one)
    colour = PALETTE[number % len(PALETTE)] if completed else "#ffffff"
    points = thin(found.shape(one), 3500) if completed else _seen(found, drive, one)
    x, y, z = points.T
    axes.scatter(x, y, z, color=colour, s=3.0, linewidths=0, depthshade=completed)
    text = f"{one.name} completed" if completed else f"{one.name}, one scan"
    axes.text2D(0.5, 0.03, text, transform=axes.transAxes, color=_TEXT, ha="center", fontsize=9)


def _seen(found: FinishedDrive, drive: Drive, one: FoundVehicle) -> np.ndarray:
    """Its points of its fullest scan, in the frame of its box."""
    frame = one.fullest
    boxes = boxes_by_frame(found)[frame]
    number = found.vehicles.index(one)
    scan = drive.scan(frame)
    mine = scan[owners_of(scan, boxes) == number]
    T_level_box = list(found.placed(one))[one.frames.index(frame)]
    T_box_sensor = T_level_box.inverse() @ found.T_level_sensor[frame]
    return thin(T_box_sensor.apply_numpy(mine), 2500)
