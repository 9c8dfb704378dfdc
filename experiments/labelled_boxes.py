# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes beside labels: how much too large, at which end, and the overlap.

    wildshape convert kitti-raw KITTI_RAW kitti --every 2
    wildshape simulate procedural --tracks 40 --seed 9031
    python -m experiments.labelled_boxes kitti procedural --model default RUN

The label is the data set's box, or that of the true shape's body. Near is the end or side that
faces the sensor. A mean is over objects of the means over their scans. Data converted with `--rays`
have two rows a model more.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch
import tyro
from jaxtyping import Float

import wildshape
from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError
from wildshape.evaluation.drives.overlap import UprightBox, overlaps
from wildshape.evaluation.drives.rectangles import l_shape, smallest_rectangle
from wildshape.evaluation.metrics import true_box
from wildshape.geometry.box import FittedBox
from wildshape.inference.boxes import carried
from wildshape.inference.predictor import Predictor
from wildshape.io.inputs import open_tracks
from wildshape.records import Box, Completion, Points, Track

COLUMNS = (
    "length", "width", "roof", "floor", "near end", "far end", "near side", "far side",
    "away", "BEV IoU", "3D IoU", "heading off, %",
)  # fmt: skip
_HEADING_DEG = 10.0
_OUTERMOST = 99.0  # percent; points farther out are strays


@dataclass(frozen=True)
class Settings:
    """What to measure.

    Attributes:
        data: folders of tracks or packed stores.
        model: checkpoints or names of shipped weights, a row each.
        most: objects of each.
        scans: of each object, spread evenly over its track.
    """

    data: tyro.conf.Positional[tuple[Path, ...]]
    model: tuple[str, ...] = ("default",)
    most: int = 40
    scans: int = 8


def main(settings: Settings) -> None:
    """Print a table for each of the data."""
    torch.set_num_threads(1)
    models = {name: wildshape.load(name) for name in settings.model}
    for path in settings.data:
        tracks = [_spread(track, settings.scans) for track in labelled(path)[: settings.most]]
        scans = sum(len(track.scans) for track in tracks)
        print(f"\n{path.name}: {len(tracks)} objects, {scans} scans; metres\n")
        print("| boxes | " + " | ".join(COLUMNS) + " |\n| --- |" + " ---: |" * len(COLUMNS))
        for name, boxes_of in _methods(models, rays=any(track.rays for track in tracks)):
            rows = [errors(boxes_of(track), track) for track in tracks]
            print(f"| {name} | " + " | ".join(map(shown, COLUMNS, np.mean(rows, axis=0))) + " |")


def labelled(path: Path) -> list[Track]:
    """The tracks of a data set whose boxes are known.

    Raises:
        BadInputError: there is none.
    """
    source = open_tracks(path)
    found = [source[i] for i in range(len(source))]
    found = [track for track in found if track.T_sensor_object is not None]
    found = [track for track in found if track.label_size_m or track.shape is not None]
    if not found:
        raise BadInputError(
            f"{path}: no track has true poses and a labelled size or a true shape; convert labelled"
            " data."
        )
    return found


def _spread(track: Track, scans: int) -> Track:
    last, most = len(track.scans) - 1, min(scans, len(track.scans))
    return track.part(np.linspace(0, last, most).round().astype(int).tolist())


def _methods(
    models: dict[str, Predictor], *, rays: bool
) -> Iterator[tuple[str, Callable[[Track], list]]]:
    yield "smallest rectangle", lambda track: [smallest_rectangle(scan) for scan in track.scans]
    yield "L-shape", lambda track: [l_shape(scan) for scan in track.scans]
    yield "label put on the points", _labels_on_points
    for name, model in models.items():
        yield f"{name}, one scan", lambda track, m=model: _boxes(m.complete_many(track.scans))
        yield f"{name}, track", lambda track, m=model: _boxes(m.complete_track(track.scans))
        if rays:
            yield f"{name}, one scan and its rays", partial(_with_rays, model.complete_many)
            yield f"{name}, track and its rays", partial(_with_rays, model.complete_track)


def _with_rays(complete: Callable[..., Iterable[Completion]], track: Track) -> list[UprightBox]:
    return _boxes(complete(track.scans, rays=track.rays))


def _labels_on_points(track: Track) -> list[UprightBox]:
    """The label, moved until the scan touches its near end and its near side.

    What a box of the true size and heading reaches, if it holds to the points.
    """
    return [_on_points(*pair) for pair in zip(upright_labels(track), track.scans)]


def _on_points(label: UprightBox, scan: Points) -> UprightBox:
    turn = _axes(label)
    near = _near(label)
    reach = np.percentile(near * ((scan[:, :2] - label[:2]) @ turn.T), _OUTERMOST, axis=0)
    moved = turn.T @ (near * (reach - np.array(label[3:5]) / 2))
    return label._replace(x=label.x + moved[0], y=label.y + moved[1])


def _axes(box: UprightBox) -> Float[np.ndarray, "2 2"]:
    """Its directions ahead and to the left, as rows."""
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    return np.array(((c, s), (-s, c)))


def _near(label: UprightBox) -> Float[np.ndarray, "2"]:
    """Which end and which side face the sensor: signs along its axes."""
    return np.sign(_axes(label) @ (-label.x, -label.y))


def _boxes(done) -> list[UprightBox]:
    return [upright(one.box) for one in done]


def upright(box: Box) -> UprightBox:
    """A box without its tilt."""
    return UprightBox(*box.centre, *box.size, yaw=box.yaw)


def errors(found: list[UprightBox], track: Track) -> Float[np.ndarray, "c"]:
    """The mean of an object's scans, a number for each of the columns."""
    labels = upright_labels(track)
    return np.mean([_error(*pair) for pair in zip(found, labels)], axis=0)


def upright_labels(track: Track) -> list[UprightBox]:
    """The label in each scan, sensor frame."""
    return [upright(box) for box in _labels(track)]


def _labels(track: Track) -> list[Box]:
    poses = track.T_sensor_object
    assert poses is not None
    if track.label_size_m:
        zero, size = torch.zeros(3), torch.tensor(track.label_size_m)
        box = FittedBox(zero.double(), size.double(), torch.eye(3, dtype=torch.float64))
    else:
        assert track.shape is not None
        box = true_box(track.shape, body=True)
    return [carried(box, poses[i]) for i in range(len(track.scans))]


def _error(found: UprightBox, label: UprightBox) -> tuple[float, ...]:
    off = _axes(label) @ (found.x - label.x, found.y - label.y)
    near = _near(label)
    grown = (np.array(found[3:5]) - label[3:5]) / 2
    at_near, at_far = near * off + grown, grown - near * off
    away = np.array((found.x - label.x, found.y - label.y)) @ (label.x, label.y)
    turned = abs((found.yaw - label.yaw + math.pi / 2) % math.pi - math.pi / 2)
    shared = overlaps([found], [label])
    roof, floor = (found.z - label.z + side * (found.height - label.height) / 2 for side in (1, -1))
    return (
        *(2 * grown), roof, floor, at_near[0], at_far[0], at_near[1], at_far[1],
        float(away) / math.hypot(label.x, label.y),
        float(shared.bev[0, 0]), float(shared.space[0, 0]),
        100.0 * (math.degrees(turned) > _HEADING_DEG),
    )  # fmt: skip


def shown(column: str, value: float) -> str:
    if "%" in column:
        return f"{value:.1f}"
    return f"{value:.3f}" if "IoU" in column else f"{value:+z.3f}"


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
