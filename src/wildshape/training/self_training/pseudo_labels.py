# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Self-training: what a trained network and the scans of a whole track teach the next network.

Beyond the paper (METHOD 11.3). A network trained as the paper has it poses every scan; the scans of
a track are then made to fit each other (`joint_icp.py`, `pose_graph.py`), headings
agreed on (`headings.py`), and fused. The fused, reflected cloud and the refined poses are
targets that a network can be taught from ONE scan of the track. No label enters.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.gravity import level_turn
from wildshape.geometry.ground import skirt
from wildshape.geometry.projection.field_of_view import slope, view_top
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.inference.prepare import unit_of
from wildshape.inference.tracks.joint_icp import refine_jointly, stayed_near
from wildshape.inference.tracks.pose_outliers import without_outliers
from wildshape.method.checkpoint import load_checkpoint
from wildshape.method.multiview import LossConfig
from wildshape.records import Points, SensorKind
from wildshape.training.batches.fused import FusedTargets
from wildshape.training.batches.views import ViewSampler
from wildshape.training.self_training.heading_transfer import check_transfer, transferred_signs
from wildshape.training.self_training.headings import AgreedPoses, agreed_poses
from wildshape.training.self_training.pose_graph import refine_by_graph
from wildshape.training.self_training.unseen_roof import unseen_roof

_POINTS, _SENSORS, _SCAN_POINTS = 2048, 8, 640
# Of vehicles (`unit_of`); a camera's points are dense and need no mean over so many.
_VOXEL_M: dict[SensorKind, float] = {"lidar": 0.1, "camera": 0.05}
_NEIGHBOURS, _STRAY = 4, 6.0
Progress = Callable[[int, int], None]


def fused_targets(
    teacher: Path,
    sampler: ViewSampler,
    progress: Progress = lambda *_: None,
    *,
    time_ordered: bool = True,
    headings: Path | None = None,
) -> FusedTargets:
    """Targets for all scans of a sampler, from a checkpoint and the scans alone.

    Args:
        teacher: poses the scans.
        sampler: of the tracks trained on.
        progress: called with the tracks done, and their number.
        time_ordered: the scans of a track follow each other (`LossConfig.time_ordered`).
        headings: another checkpoint, asked which way each scan looks (`heading_transfer.py`).

    Raises:
        BadInputError: a checkpoint cannot be used.
    """
    network, settings = load_checkpoint(teacher)
    views = replace(
        sampler.config,
        points=settings.input_points,
        turn="facing" if settings.facing else "none",
        sensor=settings.sensor,
    )
    asked = ViewSampler(sampler.store, np.arange(len(sampler.store)), views)
    asked.scans_of = sampler.scans_of
    loss = LossConfig(
        beta=settings.beta,
        projection=settings.projection,
        belief=settings.belief,
        time_ordered=time_ordered,
    )
    mirror = settings.network.mirror
    unit = unit_of(settings.extent_m[1])
    voxel = unit * _VOXEL_M[settings.sensor]

    def in_units(scans: np.ndarray) -> list[Points]:
        return [sampler.store.scan_points(int(scan)) / np.float32(unit) for scan in scans]

    def refined(scans: np.ndarray, T_sensor_can: SE3) -> SE3:
        clouds = in_units(scans)
        start = _scaled(without_outliers(T_sensor_can) if time_ordered else T_sensor_can, 1 / unit)
        found = refine_jointly(clouds, start, mirror=mirror)
        return _scaled(_chained(clouds, found) if time_ordered else found, unit)

    def fused(_: ViewSampler, scans: np.ndarray, T_sensor_can: SE3) -> Tensor:
        return torch.from_numpy(_shape(sampler, scans, T_sensor_can, mirror, voxel))

    def transferred(scans: np.ndarray, T_sensor_can: SE3) -> Tensor:
        assert hint is not None
        return transferred_signs(hint, in_units(scans), _scaled(T_sensor_can, 1 / unit))

    hint = None if headings is None else load(headings, raw=True)
    if hint is not None:
        check_transfer(hint)
    poses = agreed_poses(
        network, asked, loss, refined, progress, fused, transferred if hint else None, settled=True
    )
    if settings.sensor == "lidar":
        poses = _levelled(sampler, poses)
    shapes = [
        _shape(sampler, scans, _of(poses, scans), mirror, voxel) for scans in sampler.scans_of
    ]
    tops = _view_tops(sampler)
    if settings.sensor == "lidar":
        shapes = [
            _closed(shape, _sensors(poses, scans), top, mirror)
            for shape, scans, top in zip(shapes, sampler.scans_of, tops)
        ]
    return _targets(sampler, poses, shapes, tops, complete=False)


def _levelled(sampler: ViewSampler, poses: AgreedPoses) -> AgreedPoses:
    """Every track in a frame that does not pitch against its sensors (`geometry/gravity.py`)."""
    rotation = poses.rotation.clone()
    for scans in sampler.scans_of:
        rows = torch.from_numpy(scans)
        rotation[rows] = rotation[rows] @ level_turn(rotation[rows])
    return poses._replace(rotation=rotation)


def _chained(scans: list[Points], T_sensor_can: SE3) -> SE3:
    """Poses that fit their neighbours, unless a scan would jump."""
    found = refine_by_graph(scans, T_sensor_can)
    return found if stayed_near(T_sensor_can, found) else T_sensor_can


def _of(poses: AgreedPoses, scans: np.ndarray) -> SE3:
    """`T_sensor_canonical` of some scans."""
    rows = torch.from_numpy(scans)
    return SE3(poses.rotation[rows], poses.translation[rows])


def _scaled(T_a_b: SE3, factor: float) -> SE3:
    """The same transform where lengths are so many times as large."""
    return SE3(T_a_b.rotation, T_a_b.translation * factor)


def _view_tops(sampler: ViewSampler) -> list[float]:
    """Where each track's view ended above; a camera's ends where its image does: not on objects."""
    if sampler.config.sensor != "lidar":
        return [math.inf] * len(sampler.scans_of)

    def highest(scan: int) -> float:
        return float(slope(torch.from_numpy(sampler.store.scan_points(scan))).max())

    return [view_top([highest(int(scan)) for scan in scans]) for scans in sampler.scans_of]


def _closed(shape: np.ndarray, sensors: Tensor, top: float, mirror: bool) -> np.ndarray:
    """With the roof that no sensor could see, as many points as before."""
    roof = unseen_roof(torch.from_numpy(shape), sensors, top, mirror=mirror)
    return _exactly(np.concatenate((shape, roof.numpy())))


def true_targets(sampler: ViewSampler) -> FusedTargets:
    """The truth as targets: the oracle, the upper bound of METHOD 9.

    Raises:
        BadInputError: a track has no true poses or no true shape.
    """
    store = sampler.store
    count = len(store.scan_sizes)
    poses = AgreedPoses(torch.zeros(count, 3, 3), torch.zeros(count, 3))
    starts = np.asarray(store.track_starts)
    shapes = []
    for scans in sampler.scans_of:
        track = int(np.searchsorted(starts, scans[0], side="right")) - 1
        known, shape = store.poses_of(track), store.shape_of(track)
        if known is None or shape is None:
            raise BadInputError(
                f"{store.path}: track {store.names[track]} has no true poses or shape; the oracle"
                " needs both."
            )
        own = known[torch.from_numpy(scans - starts[track])]
        rows = torch.from_numpy(scans)
        poses.rotation[rows], poses.translation[rows] = (
            own.rotation.float(),
            own.translation.float(),
        )
        shapes.append(_exactly(np.asarray(shape)))
    return _targets(sampler, poses, shapes, [math.inf] * len(shapes), complete=True)


def _targets(
    sampler: ViewSampler,
    poses: AgreedPoses,
    shapes: list[np.ndarray],
    tops: list[float],
    *,
    complete: bool,
) -> FusedTargets:
    sensors = torch.stack([_sensors(poses, scans) for scans in sampler.scans_of])
    found = torch.from_numpy(np.stack(shapes))
    ends = torch.tensor(tops)
    return FusedTargets(poses.rotation, poses.translation, found, sensors, ends, complete=complete)


def _sensors(poses: AgreedPoses, scans: np.ndarray) -> Float[Tensor, "O 3"]:
    """Where the sensor stood, seen from the object, at times spread over the track."""
    rows = torch.from_numpy(scans[np.linspace(0, len(scans) - 1, _SENSORS).round().astype(int)])
    return -(poses.rotation[rows].mT @ poses.translation[rows][..., None])[..., 0]


def _shape(
    sampler: ViewSampler, scans: np.ndarray, T_sensor_can: SE3, mirror: bool, voxel_m: float
) -> Float32[np.ndarray, "G 3"]:
    """A track's scans in the canonical frame, reflected, thinned, without strays and ground."""
    rng = np.random.default_rng(0)
    clouds = []
    for index, scan in enumerate(scans):
        points = sampler.store.scan_points(int(scan))
        picked = torch.from_numpy(points[rng.permutation(len(points))[:_SCAN_POINTS]])
        clouds.append(T_sensor_can[index].inverse().apply(picked).numpy())
    fused = np.concatenate(clouds)
    if mirror:
        fused = np.concatenate((fused, fused * np.asarray((1, -1, 1), np.float32)))
    thinned = _voxel_means(fused, voxel_m)
    kept = thinned[_near_others(thinned)]
    return _exactly(kept[~skirt(kept)] if sampler.config.sensor == "lidar" else kept)


def _near_others(points: Float32[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
    """All but strays. What is merely thin stays: of a roof, seen at a glance, there is no more."""
    from scipy.spatial import KDTree

    apart = KDTree(points).query(points, k=_NEIGHBOURS + 1)[0][:, 1:].mean(axis=1)
    return apart <= _STRAY * np.median(apart)


def _voxel_means(points: Float32[np.ndarray, "n 3"], edge_m: float) -> Float32[np.ndarray, "m 3"]:
    """The mean of the points in each cube: even density, and less noise than its points."""
    cell = np.floor(points / np.float32(edge_m)).astype(np.int64)
    _, place = np.unique(cell, axis=0, return_inverse=True)
    place = place.reshape(-1)
    count = np.bincount(place)
    sums = [np.bincount(place, points[:, axis], len(count)) for axis in range(3)]
    return (np.stack(sums, axis=1) / count[:, None]).astype(np.float32)


def _exactly(points: np.ndarray) -> Float32[np.ndarray, "G 3"]:
    """A seeded choice of as many points as every target has, repeated if there are fewer."""
    order = np.random.default_rng(0).permutation(len(points))
    return np.ascontiguousarray(points[order[np.arange(_POINTS) % len(points)]], np.float32)
