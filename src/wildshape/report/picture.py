# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Pictures of point clouds by matplotlib: the README's, and the report's on paper.

Drawn on a slate card of its own, the README's picture reads the same on GitHub's light and dark
pages.
"""

import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.sampling import thin
from wildshape.io.atomic import atomic_write
from wildshape.report.content import Cloud, ReportObject
from wildshape.report.scene import Scene, scene_of

_CARD, _TEXT = "#12171e", "#e9ecf0"
_INK = "#16191d"
_FRAMES, _PER_SECOND = 36, 9
_POINTS = 1500
_ELEVATION = 22.0
_INCHES, _DPI = 2.1, 96
_COLUMNS = ("input scan", "completed", "fused by us", "truth")


def write_picture(objects: Sequence[ReportObject], path: Path) -> None:
    """Draw objects as rows, input scan -> completed -> fused (-> truth) as columns.

    Columns that no object has are left out; `.png` stands still, `.webp` turns once around.

    Raises:
        BadInputError: nothing to draw, or another suffix.
    """
    path = Path(path)
    if path.suffix not in (".png", ".webp"):
        raise BadInputError(f"{path} is no picture we write: give it the suffix .png or .webp.")
    labels = _labels(objects)
    if not labels:
        raise BadInputError(f"{path} would be empty: no object has a cloud to draw.")
    with atomic_write(path) as file:
        if path.suffix == ".png":
            figure, _ = _rows(objects, labels)
            figure.savefig(file, format="png", dpi=2 * _DPI, facecolor=_CARD)
        else:
            _animate(objects, labels, file)


def still(scene: Scene) -> bytes:
    """One object as a PNG row on white, for paper and browsers without WebGL."""
    clouds = [_thinned(cloud) for cloud in scene.clouds]
    columns = max(4, len(clouds))
    figure = _figure(1, columns, "white")
    for column, cloud in enumerate(clouds):
        axes = _panel(figure, (1, columns, column + 1), scene)
        axes.set_title(cloud.label, color=_INK, fontsize=9, y=0.97)
        _dots(axes, cloud, dark=False)
        for segment in scene.box:
            axes.plot(*segment.T, color="#59616c", linewidth=0.7, clip_on=False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=1.5 * _DPI, facecolor="white")
    return buffer.getvalue()


def _labels(objects: Sequence[ReportObject]) -> list[str]:
    present = [cloud.label for shown in objects for cloud in shown.clouds]
    known = [label for label in _COLUMNS if label in present]
    return known + [label for label in dict.fromkeys(present) if label not in _COLUMNS]


def _rows(objects: Sequence[ReportObject], labels: list[str]) -> tuple[Any, list[Any]]:
    """The figure, and its panels as (axes, starting azimuth in degrees)."""
    figure = _figure(len(objects), len(labels), _CARD)
    panels = []
    for row, shown in enumerate(objects):
        scene = scene_of(shown)
        clouds = {cloud.label: _thinned(cloud) for cloud in scene.clouds}
        for column, label in enumerate(labels):
            axes = _panel(
                figure, (len(objects), len(labels), row * len(labels) + column + 1), scene
            )
            panels.append((axes, axes.azim))
            if label in clouds:
                _dots(axes, clouds[label], dark=True)
    for column, label in enumerate(labels):
        x = (column + 0.5) / len(labels)
        figure.text(x, 0.985, label, color=_TEXT, ha="center", va="top", fontsize=11)
    return figure, panels


def _animate(objects: Sequence[ReportObject], labels: list[str], file: IO[bytes]) -> None:
    """One turn."""
    from PIL import Image

    figure, panels = _rows(objects, labels)
    figure.set_dpi(_DPI)
    frames = []
    for frame in range(_FRAMES):
        for axes, azimuth in panels:
            axes.view_init(elev=_ELEVATION, azim=azimuth + 360.0 * frame / _FRAMES)
        figure.canvas.draw()
        frames.append(Image.fromarray(np.asarray(figure.canvas.buffer_rgba())[..., :3]))
    frames[0].save(
        file,
        format="WEBP",
        save_all=True,
        append_images=frames[1:],
        duration=1000 // _PER_SECOND,
        loop=0,
        quality=60,
        method=4,
    )


def _figure(rows: int, columns: int, face: str) -> Any:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_INCHES * columns, 0.66 * _INCHES * rows + 0.25), facecolor=face)
    FigureCanvasAgg(figure)
    figure.subplots_adjust(left=0, right=1, bottom=0, top=0.95, wspace=0, hspace=0)
    return figure


def _panel(figure: Any, place: tuple[int, int, int], scene: Scene) -> Any:
    """3D axes without furniture: equal aspect, the space of the whole scene, seen from 3/4."""
    axes = figure.add_subplot(*place, projection="3d", computed_zorder=False)
    low, high = _tight(scene)
    middle, half = (low + high) / 2, (high - low) / 2
    (left, near, foot), (right, far, top) = low, high
    axes.set(xlim=(left, right), ylim=(near, far), zlim=(foot, top))
    axes.set_box_aspect(tuple(half / half.max()), zoom=1.75)
    axes.set_axis_off()
    axes.patch.set_alpha(0)
    sensor = math.degrees(math.atan2(-middle[1], -middle[0]))
    axes.view_init(elev=_ELEVATION, azim=sensor + 35.0)
    return axes


def _tight(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Bounds without the arrow; square on the ground, so that nothing is cut while it turns."""
    points = np.concatenate([cloud.points for cloud in scene.clouds])
    low, high = (points.min(0), points.max(0)) if len(points) else (scene.low, scene.high)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-3)
    half[:2] = half[:2].max()
    return middle - half, middle + half


def _thinned(cloud: Cloud) -> Cloud:
    return Cloud(cloud.label, thin(cloud.points, _POINTS), cloud.paint, cloud.size)


def _dots(axes: Any, cloud: Cloud, *, dark: bool) -> None:
    """Points in their colour, darker at the foot, so that a shape reads without axes."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgb

    color = np.array(to_rgb(cloud.paint))
    low, high = (color * 0.75, color * 0.45 + 0.55) if dark else (color * 0.45, color)
    shade = LinearSegmentedColormap.from_list("shade", [low, high])
    x, y, z = cloud.points.T
    size = (0.95 * cloud.size) ** 2 if len(x) > 600 else (1.2 * cloud.size) ** 2
    axes.scatter(x, y, z, c=z, cmap=shade, s=size, linewidths=0, depthshade=False, clip_on=False)
