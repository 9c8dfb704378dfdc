# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Real scans beside simulated ones of a car of the label's size in the label's place.

    wildshape convert kitti-raw KITTI_RAW kitti --every 4
    python -m experiments.twins kitti --out benchmarks/results/twins.webp [--cad CAD]

What differs then is the car's form and the sensor, not its size or place. Scans are cut as the real
ones are. Prints statistics and the errors of boxes, and draws one car.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro
from experiments.labelled_boxes import (
    COLUMNS,
    errors,
    labelled,
    shown,
    upright,
    upright_labels,
)
from experiments.mesh_credits import rows_of
from scipy.spatial import KDTree

import wildshape
from wildshape.cli.main import in_a_sentence
from wildshape.errors import BadInputError
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.metrics import true_box
from wildshape.inference.predictor import Predictor
from wildshape.records import Track
from wildshape.simulate.raycast import Scene
from wildshape.simulate.scan import Returns, scan
from wildshape.simulate.sensor import HDL64
from wildshape.simulate.shapes.meshes import read_mesh
from wildshape.simulate.shapes.solid import Solid
from wildshape.simulate.shapes.variety import varied
from wildshape.simulate.shapes.vehicle import ROUNDEST_M, vehicle
from wildshape.simulate.truth import visible_surface

_CUT_M, _VAN_M = 0.2, 2.0
_NOISE_M, _LOST, _GLASS, _THROUGH = 0.02, 0.05, 0.1, 0.6
_NEIGHBOURS, _NEAR_M, _DRAWN = 10, 0.35, 3
Maker = Callable[[int, Track], Solid]


@dataclass(frozen=True)
class Settings:
    """What is compared.

    Attributes:
        data: labelled tracks of an HDL-64E.
        out: picture to write.
        cad: folder of CAD meshes, for twins of their test split.
    """

    data: tyro.conf.Positional[Path]
    out: Path
    cad: Path | None = None


def main(settings: Settings) -> None:
    """Print a row for the real scans and each kind of twin."""
    torch.set_num_threads(1)
    model = wildshape.load()
    real = [track for track in labelled(settings.data) if track.label_size_m]
    if len(real) <= _DRAWN:
        raise BadInputError(f"{settings.data}: {_DRAWN + 1} labelled cars are needed; give more.")
    sets = {"real": real}
    for name, maker in _makers(settings.cad).items():
        through = _THROUGH if name == "seen through" else 0.0
        sets[name] = [_twin(track, maker(i, track), i, through) for i, track in enumerate(real)]
    names = ("points", "thickness, cm", "within 10 cm of the box, %", "deeper than 30 cm, %")
    print("| scans | " + " | ".join((*names, *COLUMNS)) + " |")
    print("| --- |" + " ---: |" * (len(names) + len(COLUMNS)))
    for name, tracks in sets.items():
        points, thick, near, deep = np.mean([_statistics(track) for track in tracks], axis=0)
        off = np.mean([errors(_boxes(model, track), track) for track in tracks], axis=0)
        cells = (f"{points:.0f}", f"{thick:.2f}", f"{near:.0f}", f"{deep:.0f}")
        print(f"| {name} | " + " | ".join((*cells, *map(shown, COLUMNS, off))) + " |", flush=True)
    _draw(settings.out, {n: tracks[_DRAWN] for n, tracks in sets.items()}, model)


def _makers(cad: Path | None) -> dict[str, Maker]:
    makers: dict[str, Maker] = {
        "procedural": _procedural, "seen through": _procedural, "other forms": _varied,
    }  # fmt: skip
    if cad is not None:
        cars = [cad / row["file"] for row in rows_of(cad, "test") if row["category"] == "car"]
        makers["CAD"] = lambda i, _: read_mesh(cars[(4 * i) % len(cars)], metres=True)
    return makers


def _kind(track: Track) -> str:
    assert track.label_size_m is not None
    return "van" if track.label_size_m[2] > _VAN_M else "hatchback"


def _procedural(number: int, track: Track) -> Solid:
    return vehicle(_kind(track), np.random.default_rng(number)).centred()


def _varied(number: int, track: Track) -> Solid:
    rng = np.random.default_rng(number)
    return varied(vehicle(_kind(track), rng, ROUNDEST_M), rng)


def _twin(track: Track, solid: Solid, seed: int, through: float) -> Track:
    """The same track as the simulator scans another car of the label's size."""
    rng = np.random.default_rng(seed)
    shape = visible_surface(solid, Scene([solid]), 8192, 0.0, rng)
    body, wanted = true_box(shape, body=True), np.array(track.label_size_m)
    moved = (solid.vertices - body.centre.numpy()) * (wanted / body.size.numpy())
    target = replace(solid, vertices=moved)
    assumed = Returns(_NOISE_M, _LOST, _GLASS, ground=False, through=through)
    scene, poses, scans = Scene([target]), track.T_sensor_object, []
    assert poses is not None
    for i in range(len(track.scans)):
        T_object_sensor = poses[i].inverse().matrix.numpy()
        points = scan(scene, target, HDL64, T_object_sensor, assumed, rng).points
        height = poses[i].inverse().apply_numpy(points)[:, 2] + wanted[2] / 2
        scans.append(points[height > _CUT_M])
    return replace(track, scans=tuple(scans))


def _statistics(track: Track) -> np.ndarray:
    """Points, the scatter about their local planes, and how many lie at the box and deep in it."""
    assert track.T_sensor_object is not None
    rows = []
    for i, points in enumerate(track.scans):
        apart, near = map(np.asarray, KDTree(points).query(points, k=_NEIGHBOURS))
        around = points[near[apart[:, -1] < _NEAR_M]]
        off = around - around.mean(1, keepdims=True)
        least = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", off, off))[:, 0] / _NEIGHBOURS
        at = track.T_sensor_object[i].inverse().apply_numpy(points)
        inside = np.array(track.label_size_m) / 2 - np.abs(at)
        inside[:, 2] = np.where(at[:, 2] > 0, inside[:, 2], np.inf)  # the floor is no face
        depth = inside.min(1)
        thick = 100 * float(np.median(np.sqrt(np.maximum(least, 0.0))))
        rows.append((len(points), thick, 100 * np.mean(depth < 0.1), 100 * np.mean(depth > 0.3)))
    return np.mean(rows, axis=0)


def _boxes(model: Predictor, track: Track) -> list[UprightBox]:
    done = model.complete_many(track.scans, track.sensor)
    return [upright(one.box) for one in done]


def _draw(out: Path, tracks: dict[str, Track], model: Predictor) -> None:
    """The last scan of one car and of its twins from above, with label and box."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(tracks), 2.4), layout="constrained", dpi=110)
    for ax, (name, track) in zip(figure.subplots(1, len(tracks), squeeze=False)[0], tracks.items()):
        label, found = upright_labels(track)[-1], _boxes(model, track)[-1]
        turn = _turn(label.yaw).T
        points = (track.scans[-1][:, :2] - (label.x, label.y)) @ turn.T
        ax.plot(*points.T, ".", ms=1.5, color="#8a8f98")
        for box, colour in ((label, "#009e73"), (found, "#d55e00")):
            ax.plot(*_outline(box, label, turn), lw=1.2, color=colour)
        ax.set_title(name, fontsize=9)
        ax.set_aspect("equal")
        ax.axis("off")
    figure.savefig(out, format="webp")


def _outline(box: UprightBox, label: UprightBox, turn: np.ndarray) -> np.ndarray:
    corners = np.array(((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1))) * (box.length, box.width) / 2
    places = corners @ _turn(box.yaw).T + (box.x - label.x, box.y - label.y)
    return (places @ turn.T).T


def _turn(yaw: float) -> np.ndarray:
    return np.array(((np.cos(yaw), -np.sin(yaw)), (np.sin(yaw), np.cos(yaw))))


if __name__ == "__main__":
    with in_a_sentence():
        main(tyro.cli(Settings))
