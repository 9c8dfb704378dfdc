# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Small pictures of tracks: a few of its scans, and all of them joined where truth says how."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from wildshape.datasets.tracks.truth import fuse_by_truth
from wildshape.evaluation.pictures import project
from wildshape.geometry.sampling import thin
from wildshape.io.progress import counted, literal
from wildshape.records import Points, Track
from wildshape.report.content import GREEN, GREY, ORANGE
from wildshape.report.scene import upright

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCANS = 3
PANELS = SCANS + 1
_POINTS = 2500
_LONGEST = 12  # letters of a scan's name


def draw_track(row: Sequence["Axes"], track: Track) -> None:
    """Draw a few scans of a track from first to last, then all of them together, on `PANELS` axes.

    With truth all panels are in the object's frame, from one viewpoint, what other scans see in
    grey. Without it each scan is drawn as its sensor sees it, from a little higher up.
    """
    clouds = _scans(track)
    whole = _whole(track)
    bounds = _bounds([*clouds, *([] if whole is None else [whole])])
    chosen = _chosen(track)
    for axes, number, cloud in zip(row, chosen, clouds):
        if whole is not None:
            _dots(axes, whole, GREY, 0.25)
        _dots(axes, cloud, ORANGE, 1.0)
        points = counted(len(track.scans[number]), "point")
        _frame(axes, bounds, literal(f"{_tail(track.scan_names[number])}: {points}"))
    for axes in row[len(clouds) :]:
        axes.set_axis_off()
    if whole is not None:
        row[-1].set_axis_on()
        _dots(row[-1], whole, GREEN, 1.0)
        _frame(row[-1], bounds, f"{counted(len(track.scans), 'scan')} by truth")


def spread(count: int, wanted: int) -> list[int]:
    """`wanted` numbers of `count`, from the first to the last, evenly."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(wanted, count))})


def _chosen(track: Track) -> list[int]:
    """Scans to draw: where truth is known, the last panel is for all of them."""
    return spread(len(track.scans), SCANS if track.T_sensor_object is not None else PANELS)


def _scans(track: Track) -> list[Float[np.ndarray, "n 3"]]:
    """The chosen scans as right, up, towards the viewer."""
    poses = track.T_sensor_object
    clouds = []
    for number in _chosen(track):
        scan = thin(track.scans[number], _POINTS)
        if poses is not None:
            clouds.append(project(poses[number].inverse().apply_numpy(scan)))
        else:
            clouds.append(_from_sensor(scan, track))
    return clouds


def _whole(track: Track) -> Float[np.ndarray, "n 3"] | None:
    if track.T_sensor_object is None:
        return None
    return project(thin(fuse_by_truth(track), 2 * _POINTS))


def _from_sensor(scan: Points, track: Track) -> Float[np.ndarray, "n 3"]:
    """Seen from the sensor's side, moved to the scan's middle."""
    points = upright(scan.astype(np.float64), track.sensor.kind)
    middle = np.median(points, axis=0)
    back = math.degrees(math.atan2(-middle[1], -middle[0]))
    return project(points - middle, back)


def _bounds(clouds: Sequence[np.ndarray]) -> tuple[float, float, float, float]:
    """Left, right, bottom, top around all but stray points, in the panels' own proportion."""
    together = np.concatenate([cloud[:, :2] for cloud in clouds])
    low, high = np.quantile(together, (0.002, 0.998), axis=0)
    middle = (low + high) / 2
    half = 1.12 * max(float((high - low)[0]) / 2, float((high - low)[1]) / 2 * 1.5, 1e-3)
    return middle[0] - half, middle[0] + half, middle[1] - half / 1.5, middle[1] + half / 1.5


def _dots(axes: "Axes", cloud: np.ndarray, color: str, alpha: float) -> None:
    """Points in one colour, the higher ones lighter, the nearer ones on top."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgb

    base = np.array(to_rgb(color))
    shade = LinearSegmentedColormap.from_list("shade", [base * 0.5, base * 0.65 + 0.35])
    order = np.argsort(cloud[:, 2])
    x, y, _ = cloud[order].T
    size = 2.2 if len(cloud) < 800 else 1.0
    axes.scatter(x, y, c=y, cmap=shade, s=size, linewidths=0, alpha=alpha)


def _frame(axes: "Axes", bounds: tuple[float, float, float, float], label: str) -> None:
    left, right, bottom, top = bounds
    axes.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], aspect="equal")
    for spine in axes.spines.values():
        spine.set_color("#e3e7ec")
    axes.set_xlabel(label, fontsize=7, color="#59616c", labelpad=1)


def _tail(name: str) -> str:
    return name if len(name) <= _LONGEST else "\N{HORIZONTAL ELLIPSIS}" + name[1 - _LONGEST :]
