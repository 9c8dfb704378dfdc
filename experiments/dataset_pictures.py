# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The pictures of docs/datasets: a simulated scene in a data set's own format, as it is read.

python experiments/dataset_pictures.py kitti-raw docs/datasets/kitti-raw.webp

Nobody's scans are drawn: the writers of the tests make the scene. To add a data set: one line in
`WRITERS`, a function that writes a scene below a folder; tests read these scenes, too. `--root`
draws a data set of yours.
"""

import io
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1]))

from wildshape.cli.main import in_a_sentence
from wildshape.datasets.sources import open_source
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.tracks.truth import fuse_by_truth
from wildshape.io.atomic import atomic_write
from wildshape.records import Track
from wildshape.report.content import GREEN, ORANGE, Cloud, ReportObject
from wildshape.report.picture import write_picture
from wildshape.report.statistics.thumbnails import PANELS, draw_track

WRITERS = {
    "folder": "tests.datasets.write_folder:picture_scene",
    "kitti-raw": "tests.datasets.write_kitti_raw:picture_scene",
    "kitti-tracking": "tests.datasets.write_kitti_tracking:picture_scene",
    "semantic-kitti": "tests.datasets.write_semantic_kitti:picture_scene",
    "shapenet-views": "tests.datasets.write_shapenet_views:picture_scene",
    "rgbd": "tests.datasets.write_rgbd:picture_scene",
    "bop": "tests.datasets.write_rgbd:picture_bop",
    "nuscenes": "tests.datasets.write_nuscenes:picture_scene",
    "waymo": "tests.datasets.write_waymo:picture_scene",
    "argoverse2": "tests.datasets.write_argoverse2:picture_scene",
    "pandaset": "tests.datasets.write_pandaset:picture_scene",
}
"""Name on the command line of `convert` -> module and function `(root: Path) -> None`."""


_WIDTH, _ROWS = 1200, 3


@dataclass(frozen=True)
class Settings:
    """Draw a track of a data set: its first, middle and last scan, and all of them by the truth.

    Attributes:
        name: of the data set, as `wildshape convert` has it.
        out: .webp to write.
        root: a data set on disk instead of the written scene; not to be committed.
        track: which of its tracks.
    """

    name: Annotated[str, tyro.conf.Positional]
    out: Annotated[Path, tyro.conf.Positional]
    root: Path | None = None
    track: int = 0


def main(settings: Settings) -> None:
    if settings.root is not None:
        draw(settings.name, settings.root, settings)
        return
    module, _, function = WRITERS[settings.name].partition(":")
    write: Callable[[Path], None] = getattr(import_module(module), function)
    with tempfile.TemporaryDirectory() as root:
        write(Path(root))
        draw(settings.name, Path(root), settings)


def draw(name: str, root: Path, settings: Settings) -> None:
    tracks = list(all_tracks(open_source(name, root, {})))
    if tracks[0].sensor.kind == "camera":
        write_rows(tracks[:_ROWS], settings.out)
    else:
        write_webp(posed(tracks[settings.track]), settings.out)


def write_rows(tracks: list[Track], out: Path) -> None:
    """A row a track: some of its scans and, where truth is known, all of them."""
    figure = Figure(figsize=(9, 1.75 * len(tracks)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(tracks), PANELS, squeeze=False)
    for row, track in zip(axes, tracks):
        draw_track(list(row), track)
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / "rows.png"
        figure.savefig(png, dpi=_WIDTH / 9)
        save_webp(Image.open(png).convert("RGB"), out)


def posed(track: Track) -> ReportObject:
    """Scans as rows of points in the object's frame, so that the panels can be compared."""
    assert track.T_sensor_object is not None
    T_object_sensor = track.T_sensor_object.inverse()
    last = len(track.scans) - 1
    chosen = {"first scan": 0, "middle scan": last // 2, "last scan": last}
    clouds = [
        Cloud(label, T_object_sensor[i].apply_numpy(track.scans[i]), ORANGE, size=2.6)
        for label, i in chosen.items()
    ]
    fused = Cloud(f"all {last + 1}, by the truth", fuse_by_truth(track), GREEN)
    # The corner that the picture looks from is that of a sensor at the origin.
    eye = T_object_sensor[last // 2].translation.numpy()
    moved = [Cloud(c.label, (c.points - eye).astype(np.float32), c.color, c.size) for c in clouds]
    fused = Cloud(fused.label, (fused.points - eye).astype(np.float32), fused.color)
    return ReportObject(track.name, clouds=(*moved, fused))


def write_webp(shown: ReportObject, out: Path) -> None:
    """A still picture of a few ten kilobytes."""
    with tempfile.TemporaryDirectory() as folder:
        png = Path(folder) / "still.png"
        write_picture([shown], png)
        pixels = Image.open(io.BytesIO(png.read_bytes())).convert("RGB")
    pixels = pixels.resize(
        (_WIDTH, _WIDTH * pixels.height // pixels.width), Image.Resampling.LANCZOS
    )
    save_webp(pixels, out)


def save_webp(pixels: Image.Image, out: Path) -> None:
    with atomic_write(out) as file:
        pixels.save(file, format="WEBP", quality=70, method=6)
    print(f"{out}: {out.stat().st_size} bytes")


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
