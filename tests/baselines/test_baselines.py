# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What holds for every baseline, and what each is known to do and not to do."""

import math

import numpy as np
import pytest
import torch
from tests.baselines.named import errors, named
from tests.cars import drive_by, half_turned, poses_of

from wildshape.baselines.icp import headings
from wildshape.baselines.identity import Identity, OneScan
from wildshape.baselines.named import NAMES
from wildshape.baselines.pairs import chain
from wildshape.baselines.rectangle import Rectangle
from wildshape.evaluation.cases import turn_track
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Sensor

LIDAR = Sensor()
BOXES = ("one-scan", "rectangle", "l-shape")
REGISTRARS = [name for name in NAMES if name not in BOXES]


def small_motions():
    """Neighbours a few degrees of viewpoint apart."""
    return [
        drive_by(seed=seed, step=0.5, heading=0.3 * seed, scans=5, points=800) for seed in range(3)
    ]


def test_identity_aligns_centroids_and_turns_nothing():
    track = drive_by()
    T = Identity().register_track(track.scans, LIDAR)
    assert torch.equal(T.rotation, SE3.identity(len(track.scans)).rotation)
    middle = track.scans[track.middle].mean(axis=0)
    for i, scan in enumerate(track.scans):
        assert T[i].apply_numpy(scan).mean(axis=0) == pytest.approx(middle, abs=1e-3)
    assert torch.equal(T.translation[track.middle], torch.zeros(3, dtype=torch.float64))


@pytest.mark.parametrize("name", [name for name in REGISTRARS if name != "identity"])
def test_a_known_motion_is_recovered_exactly(name):
    # The same points seen again, moved: an exact fit exists.
    source = drive_by(scans=1, points=800).scans[0]
    angle = torch.tensor(math.radians(4), dtype=torch.float64)
    T_target_source = SE3(rotation_z(angle), torch.tensor([3.0, -1, 0.1], dtype=torch.float64))
    target = T_target_source.apply_numpy(source)
    # The target is scan 1 of 2, the middle one.
    found = named(name).register_track([source, target], LIDAR)[0]
    # Features do not use the points themselves but a thinned cloud.
    within = 0.15 if name == "kiss-matcher" else 2e-3
    assert (found.inverse() @ T_target_source).angle() < within
    assert found.apply_numpy(source) == pytest.approx(target, abs=5 * within)


@pytest.mark.parametrize("name", ["local-icp", "global-icp", "multi-start-icp", "gicp"])
def test_small_motions_are_chained(name):
    """Bar: the chained error is under 5 degrees median."""
    method = named(name)
    found = [errors(method, track) for track in small_motions()]
    assert torch.cat([e.rotation_deg for e in found]).median() < 5
    assert torch.cat([e.translation_m for e in found]).median() < 0.3


@pytest.mark.parametrize("name", ["local-icp", "gicp"])
def test_local_methods_fail_at_a_half_turn(name):
    # Only the turned scan is lost: for those behind it the turn there and back is none at all,
    # and that is what ICP answers twice.
    error = errors(named(name), half_turned(drive_by(step=0.5), 3))
    lost = error.rotation_deg > 150
    assert lost.tolist() == [i == 3 for i in range(11)]
    assert error.rotation_deg[~lost].max() < 10
    assert error.rotation_sym_deg.max() < 10


@pytest.mark.parametrize("name", ["global-icp", "multi-start-icp"])
def test_global_methods_survive_a_half_turn(name):
    track = half_turned(drive_by(step=0.5, scans=3, points=800), 0)
    assert errors(named(name), track).rotation_deg.max() < 10


@pytest.mark.parametrize(("kind", "axis"), [("lidar", 2), ("camera", 1)])
def test_headings_turn_about_the_vertical_of_the_sensor(kind, axis):
    turns = headings(4, kind)
    up = torch.eye(3, dtype=torch.float64)[axis]
    assert torch.allclose(torch.stack([T.rotation @ up for T in turns]), up)
    degrees = [round(math.degrees(float(T.angle()))) for T in turns]
    assert degrees == [0, 90, 180, 90]
    # Two different quarter turns.
    assert float((turns[1] @ turns[3]).angle()) < 1e-6


def test_multi_start_icp_knows_a_cameras_vertical():
    track = drive_by(scans=3, step=0.5, points=800)
    # From LiDAR to camera axes (x right, y down, z forward), then turned about the camera's y.
    rows = torch.tensor([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]], dtype=torch.float64)
    T_camera_lidar = SE3(rows, torch.zeros(3, dtype=torch.float64))
    camera = Sensor("camera")
    seen = type(track)(
        name=track.name,
        scans=tuple(T_camera_lidar.apply_numpy(scan) for scan in track.scans),
        scan_names=track.scan_names,
        sensor=camera,
        T_sensor_object=T_camera_lidar @ poses_of(track),
    )
    assert errors(named("multi-start-icp"), turn_track(seen, "yaw", seed=1)).rotation_deg.max() < 10


def test_chain_multiplies_neighbours_up_to_the_middle():
    # Scan i holds the one number i; a pair's motion is made of both.
    scans = [np.full((1, 3), i, np.float32) for i in range(5)]

    def align(source, target):
        angle = torch.tensor(0.01 * float(source[0, 0]), dtype=torch.float64)
        return SE3(rotation_z(angle), torch.as_tensor(target[0] - source[0]).double())

    T = chain(scans, align)
    for i in range(5):
        assert float(T[i].angle()) == pytest.approx([0.01, 0.01, 0, 0.03, 0.07][i], abs=1e-9)
        assert T[i].translation[2] == pytest.approx(2.0 - i)


@pytest.mark.parametrize("name", REGISTRARS)
def test_every_registrar_is_repeatable_and_leaves_its_scans_alone(name):
    method = named(name)
    track = drive_by(scans=3, points=300)
    kept = [scan.copy() for scan in track.scans]
    once = method.register_track(list(track.scans), LIDAR).matrix
    assert torch.equal(once, method.register_track(list(track.scans), LIDAR).matrix)
    assert all(np.array_equal(a, b) for a, b in zip(kept, track.scans, strict=True))
    assert torch.equal(once[track.middle], torch.eye(4, dtype=torch.float64))


@pytest.mark.parametrize("name", REGISTRARS)
def test_poor_scans_are_answered_with_a_rotation(name):
    """Sixteen points, a line, a plane, a speck, strays: no crash, no NaN."""
    rng = np.random.default_rng(0)
    cloud = rng.normal(size=(16, 3)) * [2.0, 0.8, 0.5]
    poor = [
        cloud,
        cloud * [1, 0, 0],
        cloud * [1, 1, 0],
        cloud * 1e-3,
        cloud * 50,
        rng.normal(size=(60, 3)) * [2.0, 0.8, 0.5],
    ]
    scans = [(points + np.array([10, 4, -1])).astype(np.float32) for points in poor]
    T = named(name).register_track(scans, LIDAR)
    identity = torch.eye(3, dtype=torch.float64).expand(len(scans), 3, 3)
    assert torch.allclose(T.rotation @ T.rotation.mT, identity, atol=1e-5)
    assert bool(torch.isfinite(T.translation).all())


@pytest.mark.parametrize("name", REGISTRARS)
def test_fused_track_is_all_points_in_the_middle_frame(name):
    track = drive_by(scans=3)
    fused = named(name).complete_track(track.scans, LIDAR)
    assert fused.shape == (sum(map(len, track.scans)), 3)
    assert fused.dtype == np.float32
    start = sum(map(len, track.scans[: track.middle]))
    middle = track.scans[track.middle]
    assert np.array_equal(fused[start : start + len(middle)], middle)


@pytest.mark.parametrize("name", NAMES)
def test_a_track_of_one_scan_is_its_own_completion(name):
    scan = drive_by(scans=1).scans[0]
    method = named(name)
    if isinstance(method, (OneScan, Rectangle)):
        assert np.array_equal(method.complete(scan, LIDAR), scan)
    else:
        assert np.array_equal(method.complete_track([scan], LIDAR), scan)
