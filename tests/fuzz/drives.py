# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of published data sets: whole data sets of one or two frames, one file damaged."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from tests.datasets import write_argoverse2 as av2
from tests.datasets import write_kitti_raw as raw
from tests.datasets import write_kitti_tracking as tracking
from tests.datasets import write_nuscenes as nuscenes
from tests.datasets import write_pandaset as pandaset
from tests.datasets import write_rgbd as rgbd
from tests.datasets import write_semantic_kitti as semantic
from tests.datasets import write_shapenet_views as shapenet
from tests.datasets import write_waymo as waymo
from tests.datasets.street import street
from tests.fuzz.target import Arrays, Target, numbers_of

from wildshape.datasets.argoverse2.reader import Argoverse2
from wildshape.datasets.kitti.raw import KittiRaw
from wildshape.datasets.kitti.tracking import KittiTracking
from wildshape.datasets.nuscenes.reader import NuScenes
from wildshape.datasets.pandaset.reader import PandaSet
from wildshape.datasets.rgbd.bop import Bop
from wildshape.datasets.rgbd.reader import Rgbd
from wildshape.datasets.semantic_kitti.reader import SemanticKitti
from wildshape.datasets.shapenet.reader import ShapeNetViews
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.source import all_tracks
from wildshape.datasets.waymo.reader import Waymo

_ALL = Selection(min_points=16)
_FRAMES = 2
_LENS = {"fx": 35.0, "fy": 36.0, "cx": 19.7, "cy": 15.2, "width": 40, "height": 30}


def _few(eye: tuple[float, float, float] = (1.3, 0.0, 1.6)) -> Any:
    """Two frames of the street, each point a few times as far from its neighbour."""
    return street(frames=_FRAMES, points=120, eye=eye)


def _tracks(source: Any) -> Arrays:
    for track in all_tracks(source):
        yield from numbers_of(track)


def _build_semantic(folder: Path) -> None:
    semantic.write_sequence(folder / "street" / "sequences" / "00", _few(semantic.EYE))


def _build_tracking(folder: Path) -> None:
    tracking.write_sequence(folder / "plain" / "training", _few(tracking.EYE))
    tracking.write_sequence(folder / "oxts" / "training", _few(tracking.EYE), oxts=True, colon="")


def _build_raw(folder: Path) -> None:
    rng = np.random.default_rng(3)
    car = ("Car", 0, [(8.0 - i, 3.0, -1.7, 0.1) for i in range(_FRAMES)])
    clouds = {}
    for i, pose in enumerate(car[2]):
        surface = rng.uniform(-0.5, 0.5, (40, 3)) * raw.SIZE + (0, 0, raw.SIZE[2] / 2)
        clouds[i] = raw.in_velo(surface, pose)
    day = folder / "drive" / "2011_09_26"
    drive = raw.write_drive(day / "2011_09_26_drive_0001_sync", [car], clouds)
    (drive / "oxts" / "data").mkdir(parents=True)
    for i in range(_FRAMES):
        numbers = [49.0, 8.4, 112.0, 0.01, 0.02, 0.3, *[0.0] * 24]
        (drive / "oxts" / "data" / f"{i:010d}.txt").write_text(" ".join(map(str, numbers)) + "\n")
    (day / "calib_imu_to_velo.txt").write_text("R: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n")
    raw.write_drive(folder / "bare" / "drive", [car], clouds)


def _build_nuscenes(folder: Path) -> None:
    thing = nuscenes.Thing("car", keys=(0, 1))
    scenes = [nuscenes.Scene(things=(thing,), keys=2, sweeps_between=1)]
    nuscenes.write_nuscenes(folder / "mini", scenes, count=60)


def _read_nuscenes(folder: Path) -> Arrays:
    """Its index is kept by what the tables are, so each input gets a cache of its own."""
    cache = Path(tempfile.mkdtemp(dir=folder.parent.parent))
    try:
        yield from _tracks(NuScenes(folder, _ALL, sweeps=True, cache=cache))
    finally:
        shutil.rmtree(cache)


def _build_argoverse2(folder: Path) -> None:
    av2.write_log(folder / "log" / "sensor" / "val" / av2.LOG, _few())


def _build_waymo(folder: Path) -> None:
    car = waymo.Thing("Kw3hbYbGR0iVbsqyFoD9uQ", frames=(0, 1))
    for name, table in (("table", True), ("even", False)):
        root = folder / name / "training"
        waymo.write_waymo(root, [car], frames=_FRAMES, table=table, shape=(10, 180))


def _build_pandaset(folder: Path) -> None:
    pandaset.write_scene(folder / "scene" / "001", _few())


def _build_shapenet(folder: Path) -> None:
    shapenet.write_data(folder / "chair", models=("a",), splits=("train",), views=2, pixels=24)
    for split in ("val", "test"):
        shapenet.write_list(folder / "chair", split, ["none"])


def _build_rgbd(folder: Path) -> None:
    rgbd.write_sequence(folder / "together" / "kitchen", _FRAMES, camera=_LENS)
    rgbd.write_sequence(folder / "apart" / "kitchen", _FRAMES, camera=_LENS, apart=True)


def _build_bop(folder: Path) -> None:
    rgbd.write_bop(folder / "plain", _FRAMES, camera=_LENS)
    rgbd.write_bop(folder / "world", 1, camera=_LENS, world=True)
    rgbd.write_model(folder / "world")


TARGETS = (
    Target("semantic-kitti", _build_semantic, lambda f: _tracks(SemanticKitti(f, _ALL)), 1),
    Target("kitti-tracking", _build_tracking, lambda f: _tracks(KittiTracking(f, _ALL)), 1),
    Target("kitti-raw", _build_raw, lambda f: _tracks(KittiRaw(f, _ALL)), 1.5),
    Target("nuscenes", _build_nuscenes, _read_nuscenes, 0.7),
    Target("argoverse2", _build_argoverse2, lambda f: _tracks(Argoverse2(f, _ALL)), 1),
    Target("waymo", _build_waymo, lambda f: _tracks(Waymo(f, _ALL)), 0.8),
    Target("pandaset", _build_pandaset, lambda f: _tracks(PandaSet(f, _ALL)), 1.5),
    Target("shapenet-views", _build_shapenet, lambda f: _tracks(ShapeNetViews(f, _ALL)), 0.8),
    Target("rgbd", _build_rgbd, lambda f: _tracks(Rgbd(f, _ALL)), 0.8),
    Target("bop", _build_bop, lambda f: _tracks(Bop(f, _ALL)), 0.6),
)
