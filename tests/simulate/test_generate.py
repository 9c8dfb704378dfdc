# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whole tracks: truth fits the scans, and a seed makes the same bytes with any workers."""

from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from scipy.spatial import KDTree
from tests.cars import poses_of, shape_of

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import rotations_about
from wildshape.records import Track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.simulate.occluder import occluders
from wildshape.simulate.scan import Turn
from wildshape.simulate.sensor import SensorName
from wildshape.simulate.shapes.solid import box
from wildshape.simulate.varied_scans import cut_above_ground


def _bytes(track: Track) -> bytes:
    arrays = (*track.scans, np.asarray(poses_of(track)), shape_of(track))
    return b"".join(np.ascontiguousarray(a).tobytes() for a in arrays) + track.source.encode()


def _tracks(config: SimulationConfig, seed: int = 0, workers: int = 1) -> list[Track]:
    return list(simulate_tracks(config, seed, workers))


@pytest.mark.parametrize("sensor", get_args(SensorName))
def test_points_carried_back_lie_on_the_truth_shape(sensor: SensorName) -> None:
    lidar = sensor != "depth-camera"
    config = SimulationConfig(tracks=2, sensor=sensor, scans=6 if lidar else 3)
    for track in _tracks(config):
        assert shape_of(track).shape == (8192, 3)
        assert shape_of(track).dtype == np.float32
        tree = KDTree(shape_of(track))
        spacing = 0.12 if lidar else 0.03
        for i, scan in enumerate(track.scans):
            assert len(scan) >= 100
            assert scan.dtype == np.float32
            off, _ = tree.query(poses_of(track)[i].inverse().apply_numpy(scan))
            assert np.quantile(off, 0.99) < spacing + (0.06 if lidar else 0.0)
            assert np.median(off) < 0.5 * spacing


def test_a_lidar_shape_is_centred_and_upright() -> None:
    for track in _tracks(SimulationConfig(tracks=3, scans=4)):
        low, high = shape_of(track).min(0), shape_of(track).max(0)
        assert np.abs(low + high)[:2].max() < 0.1
        assert high[0] - low[0] > high[1] - low[1] > 1.5


def test_the_same_seed_makes_the_same_bytes_with_any_workers() -> None:
    config = SimulationConfig(tracks=5, scans=5, occlusion=0.5, ground=True)
    alone = [_bytes(t) for t in _tracks(config, seed=3)]
    assert alone == [_bytes(t) for t in _tracks(config, seed=3, workers=2)]
    fewer = [
        _bytes(t)
        for t in _tracks(SimulationConfig(tracks=2, scans=5, occlusion=0.5, ground=True), 3)
    ]
    assert alone[:2] == fewer
    assert len(set(alone)) == 5
    assert alone[0] != _bytes(_tracks(config, seed=4)[0])


def test_half_of_the_varied_scans_are_cut_off_above_the_ground() -> None:
    config = SimulationConfig(tracks=6, scans=8, occlusion=0.0, shape_points=512, varied=True)
    lowest = []
    for track in _tracks(config):
        floor = shape_of(track)[:, 2].min()
        for i, scan in enumerate(track.scans):
            z = poses_of(track)[i].inverse().apply_numpy(scan)[:, 2]
            lowest.append(np.sort(z)[3] - floor)
    share = np.mean(np.array(lowest) > 0.12)
    assert 0.2 < share < 0.7


def test_a_scan_is_cut_off_at_one_height_above_the_ground_however_its_sensor_leans() -> None:
    rng, target = np.random.default_rng(0), box((-2.0, -0.9, -0.75), (2.0, 0.9, 0.75))
    T = np.eye(4)
    T[:3, :3] = (rotations_about(2, np.array([0.7])) @ rotations_about(1, np.array([0.2])))[0]
    T[:3, 3] = 5.0, -3.0, 1.0
    at = rng.uniform(-0.75, 0.75, (400, 3))
    turn = Turn((at - T[:3, 3]) @ T[:3, :3], 400, 0.0, np.zeros((0, 3)))
    heights = []
    for _ in range(20):
        kept = cut_above_ground(turn, T, target, rng).points
        z = np.sort((kept @ T[:3, :3].T + T[:3, 3])[:, 2])
        np.testing.assert_allclose(z, np.sort(at[:, 2])[-len(z) :])
        heights += [z[0] + 0.75] if len(z) < 400 else []
    assert 5 < len(heights) < 15
    assert 0.05 < min(heights) < max(heights) < 0.36


def test_occluders_stand_on_the_ground_of_the_object_clear_of_it_and_of_the_sensor() -> None:
    rng, target = np.random.default_rng(0), box((-2.0, -0.9, -0.75), (2.0, 0.9, 0.75))
    sensors = np.column_stack((np.linspace(-12, 12, 25), np.full(25, 6.0), np.full(25, 1.0)))
    things = [thing for _ in range(40) for thing in occluders(target, sensors, rng)]
    assert len(things) > 40
    for low, high in (thing.bounds for thing in things):
        assert low[2] == pytest.approx(-0.75, abs=0.05)
        apart = np.maximum(low - target.bounds[1], target.bounds[0] - high)[:2]
        assert apart.max() > 0.199
        outside = np.maximum(low[:2] - sensors[:, :2], sensors[:, :2] - high[:2]).max(1)
        assert outside.min() > 1.0


def test_occluders_reduce_points() -> None:
    def points(occlusion: float) -> list[int]:
        config = SimulationConfig(tracks=12, scans=4, occlusion=occlusion, shape_points=64)
        return [sum(len(s) for s in t.scans) for t in _tracks(config, seed=1)]

    free, occluded = points(0.0), points(0.999)
    fewer = sum(b < 0.97 * a for a, b in zip(free, occluded))
    assert fewer >= 3


def test_as_many_scans_as_asked_for_and_never_under_100_points() -> None:
    for track in _tracks(SimulationConfig(tracks=4, sensor="hdl32", occlusion=0.9)):
        assert len(track.scans) == len(track.scan_names) == 24
        assert min(len(s) for s in track.scans) >= 100
        assert track.sensor.resolution_deg == (0.1667, 1.3335)
        assert track.source.startswith("simulated hdl32 ")
    varied = [len(t.scans) for t in _tracks(SimulationConfig(tracks=8, vary_scans=True))]
    assert len(set(varied)) > 2
    assert all(12 <= n <= 40 for n in varied)


def test_the_depth_camera_is_dpcs() -> None:
    (track,) = _tracks(SimulationConfig(tracks=1, sensor="depth-camera", category="airplane"))
    assert len(track.scans) == 5
    camera = track.sensor.intrinsics
    assert camera is not None
    assert (camera.fx, camera.cx, camera.width) == (240.0, 64.0, 128)
    assert track.sensor.kind == "camera"


def test_a_users_meshes(tmp_path: Path) -> None:
    import trimesh

    (tmp_path / "deep").mkdir()
    for name, length in (("b.ply", 2.0), ("deep/a.stl", 2.4)):
        brick = box((-length, -0.9, 0.0), (length, 0.9, 1.5))
        trimesh.Trimesh(brick.vertices, brick.faces).export(tmp_path / name)
    config = SimulationConfig(tracks=3, scans=3, meshes=tmp_path)
    assert [t.source.split()[-1] for t in _tracks(config)] == ["b", "a", "b"]


@pytest.mark.parametrize("corner", [-1, 8, 3_000_000_000])
def test_triangles_without_their_corners_are_refused(tmp_path: Path, corner: int) -> None:
    import trimesh

    text = str(trimesh.creation.box((4, 2, 1)).export(file_type="off"))
    head = text.rstrip().rpartition(" ")[0]
    (tmp_path / "car.off").write_text(f"{head} {corner}\n")
    with pytest.raises(BadInputError, match=r"car\.off"):
        _tracks(SimulationConfig(tracks=1, meshes=tmp_path))


def test_triangles_that_a_file_cannot_hold_are_refused(tmp_path: Path) -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "element face 100000\n"
    head += "property list uchar int vertex_indices\nend_header\n"
    (tmp_path / "car.ply").write_bytes(head.encode() + bytes(100_000))
    with pytest.raises(BadInputError, match=r"car\.ply: the header promises 100000 'face' rows"):
        _tracks(SimulationConfig(tracks=1, meshes=tmp_path))


@pytest.mark.parametrize(
    ("size", "message"), [(4000.0, "millimetres"), (0.1, "unit scale")], ids=["mm", "unit"]
)
def test_meshes_not_in_metres_are_refused(tmp_path: Path, size: float, message: str) -> None:
    import trimesh

    trimesh.creation.box((size, size / 2, size / 2)).export(tmp_path / "odd.ply")
    with pytest.raises(BadInputError, match=rf"odd\.ply.*{message}"):
        _tracks(SimulationConfig(tracks=1, meshes=tmp_path))
    assert _tracks(SimulationConfig(tracks=1, meshes=tmp_path, sensor="depth-camera"))


def test_a_worker_hands_on_what_it_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.ply").write_bytes(b"ply\nnonsense")
    with pytest.raises(BadInputError, match=r"broken\.ply"):
        _tracks(SimulationConfig(tracks=2, meshes=tmp_path), workers=2)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tracks": 0}, "tracks is 0"),
        ({"scans": 0}, "scans is 0"),
        ({"occlusion": 1.5}, "occlusion is 1.5"),
        ({"noise_m": -1.0}, "noise_m"),
        ({"category": "chair"}, "depth-camera"),
        *(({"sensor": "depth-camera", of: True}, of) for of in ("rays", "ground", "varied")),
    ],
)
def test_bad_settings_are_refused_in_one_sentence(wrong: dict, message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        SimulationConfig(**wrong)


def test_missing_and_empty_mesh_folders(tmp_path: Path) -> None:
    (tmp_path / "._car.ply").touch()  # of an archive made on a Mac
    for folder, message in ((tmp_path / "none", "no folder"), (tmp_path, "holds no mesh")):
        with pytest.raises(BadInputError, match=message):
            _tracks(SimulationConfig(tracks=1, meshes=folder))
