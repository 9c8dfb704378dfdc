# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a store of tracks holds, on one sheet or one page: distributions, then thumbnails."""

import io
import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wildshape.inference.registration import to_middle
from wildshape.io.atomic import atomic_write
from wildshape.io.progress import counted, literal
from wildshape.records import Track
from wildshape.report.content import Cell, Figure, Report, ReportObject, Table, track_object
from wildshape.report.page.html import write_report
from wildshape.report.statistics.drawing import (
    INK,
    SOFT,
    draw_panel,
    is_rose,
    number,
    panels_of,
)
from wildshape.report.statistics.statistics import Quantity, Statistics
from wildshape.report.statistics.thumbnails import PANELS, draw_track

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

_COLUMNS = 5
_SHARES = (0.05, 0.5, 0.95)
_IN_3D = 4


def write_sheet(title: str, found: Statistics, tracks: Sequence[Track], path: Path) -> None:
    """One PNG: all distributions, and thumbnails of the tracks."""
    png = _png(_draw_sheet(title, found, tracks), dpi=110)
    with atomic_write(path) as file:
        file.write(png)


def write_statistics_page(
    title: str, found: Statistics, tracks: Sequence[Track], path: Path
) -> None:
    """One self-contained HTML page: numbers, distributions, thumbnails, a few tracks in 3D."""
    write_report(_report(title, found, tracks), path)


def summary_line(found: Statistics) -> str:
    """How much there is, in one line."""
    parts = [counted(found.tracks, "track")]
    if found.scans is not None and found.points is not None:
        parts += [counted(found.scans, "scan"), counted(found.points, "point")]
    if found.with_poses is not None:
        parts += [f"{found.with_poses:,} with true poses, {found.with_shape:,} with true shapes"]
    single = [next(iter(c)) for c in (found.categories, found.sensors) if len(c) == 1]
    return "; ".join([*parts, *filter(None, single), *filter(None, [_motion(found)])])


def _motion(found: Statistics) -> str:
    """Whether only moving or only parked objects were asked for when the tracks were made."""
    settings = found.provenance.get("settings")
    selection = settings.get("selection") if isinstance(settings, dict) else None
    motion = selection.get("motion") if isinstance(selection, dict) else None
    return f"{motion} objects only" if motion in ("moving", "parked") else ""


def read_line(found: Statistics) -> str:
    """What was read to find that out."""
    if found.read == found.tracks:
        return "The points of all tracks were read."
    if found.unusable and found.scans is not None:
        return f"The points of {found.read:,} of {found.tracks:,} tracks can be read."
    return (
        f"Points were read of a sample of {counted(found.read, 'track')}, drawn by chance, seed 0."
    )


def _draw_sheet(title: str, found: Statistics, tracks: Sequence[Track]) -> "Drawing":
    panels = panels_of(found)
    upper = math.ceil(len(panels) / _COLUMNS)
    lower = math.ceil(len(tracks) / 2)
    heights = (0.5, 2.1 * upper, 0.35 + 1.42 * lower)
    figure = _figure(14.0, sum(heights))
    bands: Any = figure.subfigures(3, 1, height_ratios=heights)
    top, middle, bottom = bands
    top.text(0.012, 0.55, literal(title), fontsize=15, weight="bold", color=INK, va="center")
    top.text(
        0.012, 0.0, literal(f"{summary_line(found)}. {read_line(found)}"), fontsize=9, color=SOFT
    )
    _draw_panels(middle, panels, upper)
    if tracks:
        _draw_thumbnails(bottom, tracks)
    return figure


def _draw_panels(figure: Any, panels: list[Any], rows: int) -> None:
    for place, panel in enumerate(panels, start=1):
        kind = "polar" if is_rose(panel) else None
        draw_panel(figure.add_subplot(rows, _COLUMNS, place, projection=kind), panel)


def _draw_thumbnails(figure: Any, tracks: Sequence[Track]) -> None:
    """Two tracks a row, each with its name above its panels."""
    rows = math.ceil(len(tracks) / 2)
    for half, track in zip(figure.subfigures(rows, 2, squeeze=False, wspace=0.02).flat, tracks):
        axes = half.subplots(1, PANELS, gridspec_kw={"wspace": 0.03})
        draw_track(list(axes), track)
        words = (track.name, track.category, counted(len(track.scans), "scan"), track.source)
        name = literal(", ".join(word for word in words if word)[:90])
        half.suptitle(name, fontsize=8, color=INK, x=0.01, ha="left")


def _figure(width: float, height: float) -> "Drawing":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as MatplotlibFigure

    figure = MatplotlibFigure(figsize=(width, height), facecolor="white", layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _png(figure: "Drawing", dpi: int = 160) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # names in scripts that matplotlib's font lacks
        figure.savefig(buffer, format="png", dpi=dpi, facecolor="white")
    return buffer.getvalue()


def _report(title: str, found: Statistics, tracks: Sequence[Track]) -> Report:
    figures = [Figure(_caption(panel), _panel_png(panel)) for panel in panels_of(found)]
    if tracks:
        thumbnails = _figure(14.0, 1.42 * math.ceil(len(tracks) / 2))
        _draw_thumbnails(thumbnails, tracks)
        figures.append(Figure("Tracks", _png(thumbnails), wide=True))
    return Report(
        title=title,
        summary=f"{summary_line(found)}.\n\n{read_line(found)}",
        tables=tuple(_tables(found)),
        objects=tuple(_in_3d(track) for track in tracks[:_IN_3D]),
        notes=tuple(f"{what}: {why}" for what, why in list(found.unusable.items())[:20]),
        provenance=found.provenance,
        figures=tuple(figures),
    )


def _panel_png(panel: Any) -> bytes:
    figure = _figure(4.6, 2.6)
    draw_panel(figure.add_subplot(projection="polar" if is_rose(panel) else None), panel)
    return _png(figure)


def _caption(panel: Any) -> str:
    return f"{panel.title} ({panel.basis})" if isinstance(panel, Quantity) else panel[0]


def _tables(found: Statistics) -> list[Table]:
    columns = ("", "counted", "least", "5 %", "median", "95 %", "most", "mean", "from")
    rows = tuple(_row(quantity) for quantity in found.quantities)
    tables = [Table("Distributions", columns, rows)]
    counted = (
        ("Categories", found.categories, "tracks"),
        ("Sensors", found.sensors, "tracks"),
        ("Sources", found.sources, "tracks"),
        ("Left out when the tracks were made", found.left_out, "how many"),
    )
    for name, counts, what in counted:
        rows = tuple((word or "not said", count) for word, count in list(counts.items())[:30])
        if counts and set(counts) != {""}:
            tables.append(Table(name, ("", what), rows))
    return tables


def _row(quantity: Quantity) -> tuple[Cell, ...]:
    tally = quantity.tally
    name = f"{quantity.title}{f', {quantity.unit}' if quantity.unit else ''}"
    numbers = (tally.least, *(tally.quantile(s) for s in _SHARES), tally.most, tally.mean)
    return (name, f"{tally.count:,}", *map(number, numbers), quantity.basis)


def _in_3d(track: Track) -> ReportObject:
    """A track as linked panels in the frame of its middle scan."""
    poses = track.T_sensor_object
    return track_object(track, fused={} if poses is None else {"fused by truth": to_middle(poses)})
