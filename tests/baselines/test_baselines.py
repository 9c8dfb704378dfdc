# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import numpy as np
import pytest
import torch
from tests.cars import drive_by, half_turned

from wildshape.baselines.identity import Identity, OneScan
from wildshape.baselines.local_icp import LocalIcp
from wildshape.evaluation.metrics import registration_error
from wildshape.geometry.rotation import rotation_z
from wildshape.geometry.se3 import SE3
from wildshape.records import Sensor

LIDAR = Sensor()


def errors(method, track):
    T_middle_scan = method.register_track(list(track.scans), track.sensor)
    poses = track.T_sensor_object
    return registration_error(T_middle_scan, poses, poses[track.middle])


def test_identity_aligns_centroids_and_turns_nothing():
    track = drive_by()
    T = Identity().register_track(track.scans, LIDAR)
    assert torch.equal(T.rotation, SE3.identity(len(track.scans)).rotation)
    middle = track.scans[track.middle].mean(axis=0)
    for i, scan in enumerate(track.scans):
        assert T[i].apply_numpy(scan).mean(axis=0) == pytest.approx(middle, abs=1e-3)
    assert torch.equal(T.translation[track.middle], torch.zeros(3, dtype=torch.float64))


def test_local_icp_recovers_a_known_motion_exactly():
    # The same points seen again, moved: an exact fit exists.
    source = drive_by(scans=1).scans[0]
    angle = torch.tensor(math.radians(4), dtype=torch.float64)
    T_target_source = SE3(rotation_z(angle), torch.tensor([30.0, -1, 0.1], dtype=torch.float64))
    found = LocalIcp().align(source, T_target_source.apply_numpy(source))
    assert (found.inverse() @ T_target_source).angle() < 1e-3
    assert found.apply_numpy(source) == pytest.approx(T_target_source.apply_numpy(source), abs=5e-3)


def test_local_icp_chains_small_motions():
    tracks = [drive_by(seed=seed, step=0.5, heading=0.3 * seed) for seed in range(4)]
    found = [errors(LocalIcp(), track) for track in tracks]
    assert torch.cat([e.rotation_deg for e in found]).median() < 5
    assert torch.cat([e.translation_m for e in found]).median() < 0.3


def test_local_icp_fails_at_a_half_turn():
    # Only the turned scan is lost: for those behind it the turn there and back is none at all,
    # and that is what ICP answers twice.
    error = errors(LocalIcp(), half_turned(drive_by(step=0.5), 3))
    lost = error.rotation_deg > 150
    assert lost.tolist() == [i == 3 for i in range(11)]
    assert error.rotation_deg[~lost].max() < 10
    assert error.rotation_sym_deg.max() < 10


@pytest.mark.parametrize("method", [Identity(), LocalIcp()])
def test_fused_track_is_all_points_in_the_middle_frame(method):
    track = drive_by(scans=5)
    fused = method.complete_track(track.scans, LIDAR)
    assert fused.shape == (sum(map(len, track.scans)), 3)
    assert fused.dtype == np.float32
    start = sum(map(len, track.scans[: track.middle]))
    middle = track.scans[track.middle]
    assert np.array_equal(fused[start : start + len(middle)], middle)


def test_a_track_of_one_scan_is_its_own_completion():
    scan = drive_by(scans=1).scans[0]
    assert np.array_equal(OneScan().complete(scan, LIDAR), scan)
    for method in (Identity(), LocalIcp()):
        assert np.array_equal(method.complete_track([scan], LIDAR), scan)
