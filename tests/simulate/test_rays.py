# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays of simulated frames: true of the object, and nothing else than the scans had changes."""

from dataclasses import replace

import numpy as np
from tests.cars import poses_of, shape_of

from wildshape.geometry.projection.sight_lines import standing
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.simulate.scan import Backdrop


def test_no_ray_that_came_back_passed_through_the_object() -> None:
    plain = SimulationConfig(tracks=1, scans=4, occlusion=0.999, far_m=15.0)
    config = replace(plain, rays=2048)
    (before,), (track,) = (list(simulate_tracks(one, 7, workers=1)) for one in (plain, config))
    assert before.rays == ()
    assert all(map(np.array_equal, before.scans, track.scans))
    # Lower down rays pass below the body to the ground.
    body = shape_of(track)[shape_of(track)[:, 2] > shape_of(track)[:, 2].min() + 0.4]
    larger = body * np.array((1.3, 1.3, 1.0), np.float32)
    for i, (scan, rays) in enumerate(zip(track.scans, track.rays)):
        assert rays is not None
        assert 100 < len(rays.returned) < len(rays) <= 2048
        sky = rays.directions[:, 2] > 0.0  # the car is lower than the sensor
        assert sky.any()
        assert np.isinf(rays.ranges[sky]).mean() > 0.5
        posed = (poses_of(track)[i].apply_numpy(one) for one in (body, larger))
        true, wrong = (standing(shape, scan, rays).free.mean() for shape in posed)
        assert true < 0.03 < 0.1 < wrong


def test_points_at_the_sensor_are_no_returns() -> None:
    """Drivers write them where nothing came back."""
    config = SimulationConfig(tracks=1, scans=1, occlusion=0.999, far_m=15.0, rays=2048)
    (track,) = simulate_tracks(config, 7, workers=1)
    (scan,), (rays,) = track.scans, track.rays
    assert rays is not None
    filled = np.vstack((scan, np.zeros((3, 3), scan.dtype)))
    larger = scan * np.float32(1.1)
    for said, of_scan in zip(standing(larger, filled, rays), standing(larger, scan, rays)):
        np.testing.assert_array_equal(said, of_scan)


def test_for_training_something_stands_behind_and_the_scans_stay_as_they_are() -> None:
    plain = SimulationConfig(tracks=6, scans=2, far_m=15.0, varied=True)
    before = list(simulate_tracks(plain, 3, workers=1))
    tracks = list(simulate_tracks(replace(plain, rays=1024), 3, workers=1))
    assert all(
        np.array_equal(a, b) for x, y in zip(before, tracks) for a, b in zip(x.scans, y.scans)
    )
    above = []
    for track in tracks:
        for rays in track.rays:
            assert rays is not None
            back = rays.returned
            level = back.directions[:, 2] > 0
            above.append(float(back.ranges[level].max(initial=0.0)))
    assert 0 < sum(far > 5 for far in above) < len(above)


def test_a_wall_along_the_road_is_met_on_the_far_side_and_below_its_top() -> None:
    wall, origin = Backdrop(5.0, 2.0), np.array((0.0, -10.0, 1.0))
    toward = np.array(((0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0)))
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    assert wall.distance(origin, toward, -0.5).tolist() == [15.0, np.inf, np.inf, np.inf]
    assert wall.distance(-origin, -toward, -0.5)[0] == 15.0


def test_ground_that_is_in_a_scan_is_no_ray_beside_it() -> None:
    config = SimulationConfig(
        tracks=1, scans=4, sensor="os1-128", occlusion=0.0, far_m=10.0, ground=True, rays=2048
    )
    (track,) = simulate_tracks(config, 7, workers=1)
    for scan, rays in zip(track.scans, track.rays):
        assert rays is not None
        toward = scan / np.linalg.norm(scan, axis=1, keepdims=True)
        assert (rays.directions @ toward.T).max() < 1 - 1e-6  # 0.08 degrees; columns have 0.35
