# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a report holds, as frozen records; `page.write_report` draws them.

All clouds and the box of one object are in ONE frame, a sensor's, metres: they are drawn with one
camera, so a shift between two panels is a shift in metres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wildshape.datasets.tracks.truth import whole_shape
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.registration import fuse_scans
from wildshape.io.progress import counted
from wildshape.records import Box, Points, SensorKind, Track

# Okabe & Ito 2008: told apart by colour-blind readers, on white and on black.
ORANGE, BLUE, GREEN, PINK, SKY, GREY = (
    "#d55e00",
    "#0072b2",
    "#009e73",
    "#cc79a7",
    "#56b4e9",
    "#8a8f98",
)
SERIES_COLORS = (BLUE, ORANGE, GREEN, PINK, SKY, GREY)
LABEL_COLORS = {
    "input scan": ORANGE,
    "completed": BLUE,
    "fused by us": GREEN,
    "ICP fused": PINK,
    "truth": GREY,
}

Numbers = Sequence[float | int] | np.ndarray
Cell = str | int | float | None


@dataclass(frozen=True)
class Table:
    """Rows of cells; `None` is drawn as a dash, a float with three digits.

    Attributes:
        emphasis: indices of the rows drawn bold (our own method).
        sortable: headings sort, and a field above filters the rows.
        objects: of each row the number of the report's object it leads to, None for none.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    caption: str = ""
    emphasis: tuple[int, ...] = ()
    sortable: bool = False
    objects: tuple[int | None, ...] = ()


@dataclass(frozen=True)
class Curve:
    """One diagram; a series is (name, xs, ys), values that are not finite are gaps."""

    title: str
    x_label: str
    y_label: str
    series: tuple[tuple[str, Numbers, Numbers], ...]
    log_y: bool = False


@dataclass(frozen=True)
class Cloud:
    """One panel's points.

    Attributes:
        label: the panel's title: `input scan`, `truth`, `fused by us`, `completed`, `ICP fused`.
        points: `(n, 3)` metres, in the frame of the object's other clouds.
        color: `#rrggbb`; empty takes the label's own.
        size: dot size in CSS pixels.
    """

    label: str
    points: Points
    color: str = ""
    size: float = 2.0

    @property
    def paint(self) -> str:
        """The colour to draw with."""
        return self.color or LABEL_COLORS.get(self.label, SKY)


@dataclass(frozen=True)
class ReportObject:
    """One object: a row of linked panels.

    Attributes:
        clouds: one a panel, at most eight (a browser keeps about sixteen 3D contexts alive).
        box: oriented box in the clouds' frame, drawn in each panel.
        details: (label, value) pairs under the name.
        sensor: tells which way is up; the sensor stands at the origin.
        scans: what is known of each scan of it.
        paper: whether it has a picture on paper, too.
    """

    name: str
    subtitle: str = ""
    clouds: tuple[Cloud, ...] = ()
    box: Box | None = None
    details: tuple[tuple[str, str], ...] = ()
    sensor: SensorKind = "lidar"
    scans: Table | None = None
    paper: bool = True


@dataclass(frozen=True)
class SceneView:
    """A scene that is played over time.

    Attributes:
        data: what the page's script draws, JSON values.
        picture: WebP, for paper and browsers without WebGL.
    """

    data: dict[str, Any]
    picture: bytes


@dataclass(frozen=True)
class Figure:
    """A finished picture, embedded as it is.

    Attributes:
        image: the file's content.
        wide: across the whole page, not beside others.
        kind: `png` or `webp`.
        to: a page that a click on it opens, as seen from the report's folder.
    """

    title: str
    image: bytes
    wide: bool = False
    kind: str = "png"
    to: str = ""


@dataclass(frozen=True)
class Report:
    """A whole page.

    Attributes:
        findings: the main figures in plain language, a sentence each, under the summary.
        cost: (label, value) tiles: time, steps, points.
        index: all objects, those to look at first on top.
        facts: (label, value) tiles on top.
        scene: of a drive.
        provenance: name -> anything; shown folded at the end.
    """

    title: str
    summary: str = ""
    cost: tuple[tuple[str, str], ...] = ()
    tables: tuple[Table, ...] = ()
    curves: tuple[Curve, ...] = ()
    objects: tuple[ReportObject, ...] = ()
    notes: tuple[str, ...] = ()
    provenance: dict = field(default_factory=dict)
    figures: tuple[Figure, ...] = ()
    findings: tuple[str, ...] = ()
    index: tuple[Table, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    scene: SceneView | None = None


def track_object(
    track: Track,
    *,
    completed: Points | None = None,
    box: Box | None = None,
    fused: Mapping[str, SE3] | None = None,
    details: Sequence[tuple[str, str]] = (),
) -> ReportObject:
    """A track as a row of panels, everything in the sensor frame of its middle scan.

    Args:
        track: its truth, where it has one, becomes a panel.
        completed: `(m, 3)` from the middle scan, in that scan's frame, metres.
        box: in the same frame.
        fused: label of a panel -> `T_middle_scan`, one a scan, which fuses the track.
        details: (label, value) pairs.
    """
    middle = track.middle
    scan = track.scans[middle]
    clouds = [Cloud("input scan", scan, size=2.6)]
    truth = whole_shape(track)
    if truth is not None and track.T_sensor_object is not None:
        clouds.append(Cloud("truth", track.T_sensor_object[middle].apply_numpy(truth)))
    for label, T_middle_scan in (fused or {}).items():
        clouds.append(Cloud(label, fuse_scans(track.scans, T_middle_scan)))
    if completed is not None:
        clouds.append(Cloud("completed", completed))
    others = len(track.scans) > 1
    number = f"scan {track.scan_names[middle]} of {len(track.scans)}" if others else ""
    about = (track.category, number, counted(len(scan), "point"), track.source)
    return ReportObject(
        name=track.name,
        subtitle=", ".join(part for part in about if part),
        clouds=tuple(clouds),
        box=box,
        details=tuple(details),
        sensor=track.sensor.kind,
    )
