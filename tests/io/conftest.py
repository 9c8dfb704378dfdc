# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One cloud in every format, and one track."""

from pathlib import Path

import numpy as np
import pytest
import torch
from tests.io.ply_with_lists import ply_with_lists

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.scans.writers import write_ply
from wildshape.records import Intrinsics, Sensor, Track


@pytest.fixture(scope="session")
def cloud() -> np.ndarray:
    """`(60, 3)` float32 points of a unit normal distribution."""
    return np.random.default_rng(7).normal(size=(60, 3)).astype(np.float32)


@pytest.fixture(scope="session")
def formats(tmp_path_factory: pytest.TempPathFactory, cloud: np.ndarray) -> dict[str, Path]:
    """The cloud in every format that can be read."""
    return _write_all(tmp_path_factory.mktemp("formats"), cloud)


@pytest.fixture(scope="session")
def full_scan() -> np.ndarray:
    """`(120000, 3)` float32: a turn of 64 beams, 3 to 118 m away."""
    rng = np.random.default_rng(8)
    azimuth = rng.uniform(-np.pi, np.pi, 120_000)
    reach, z = rng.uniform(3, 118, azimuth.shape), rng.uniform(-2, 6, azimuth.shape)
    scan = np.stack((reach * np.cos(azimuth), reach * np.sin(azimuth), z), axis=1)
    return scan.astype(np.float32)


@pytest.fixture(scope="session")
def full_formats(tmp_path_factory: pytest.TempPathFactory, full_scan) -> dict[str, Path]:
    """The full scan in every format that can be read."""
    return _write_all(tmp_path_factory.mktemp("full"), full_scan)


def _write_all(folder: Path, cloud: np.ndarray) -> dict[str, Path]:
    write_ply(folder / "plain.ply", cloud)
    for order in ("ascii", "binary_little_endian", "binary_big_endian"):
        (folder / f"{order}.ply").write_bytes(ply_with_lists(order, cloud))
    _write_pcd(folder, cloud)
    np.save(folder / "array.npy", cloud.astype(np.float64))
    np.savez(folder / "only.npz", cloud)
    np.savez_compressed(folder / "named.npz", points=cloud, other=cloud[:3])
    np.savetxt(folder / "rows.xyz", cloud)
    np.savetxt(folder / "header.csv", cloud, delimiter=",", header="x,y,z", comments="")
    np.hstack([cloud, np.abs(cloud[:, :1])]).tofile(folder / "kitti.bin")
    _write_las(folder, cloud)
    return {path.name: path for path in sorted(folder.iterdir())}


def _write_pcd(folder: Path, cloud: np.ndarray) -> None:
    from pypcd4.pypcd4 import Encoding, PointCloud

    for encoding in ("ascii", "binary", "binary_compressed"):
        points = PointCloud.from_xyzi_points(np.hstack([cloud, cloud[:, :1]]))
        points.save(folder / f"{encoding}.pcd", Encoding(encoding))


def _write_las(folder: Path, cloud: np.ndarray) -> None:
    import laspy

    for kind, version in ((3, "1.2"), (6, "1.4")):
        header = laspy.LasHeader(point_format=kind, version=version)
        header.scales = np.full(3, 1e-6)
        data = laspy.LasData(header)
        data.xyz = cloud.astype(np.float64)
        data.write(str(folder / f"format{kind}.las"))
        data.write(str(folder / f"format{kind}.laz"))


@pytest.fixture
def track(cloud: np.ndarray) -> Track:
    """Three scans of different sizes with truth and a camera."""
    generator = torch.Generator().manual_seed(3)
    rotation = random_rotation(3, generator).double()
    # Orthonormal to float64, unlike what was drawn in float32.
    rotation = torch.linalg.qr(rotation)[0]
    rotation = rotation * torch.linalg.det(rotation)[:, None, None]
    return Track(
        name="car-1",
        scans=(cloud, cloud[:20], cloud[:33]),
        scan_names=("000010", "000011", "000012"),
        sensor=Sensor("camera", None, Intrinsics(100.5, 100.5, 64.0, 64.0, 128, 128)),
        category="car",
        source="a test, ünïcode",
        T_sensor_object=SE3(rotation, torch.randn(3, 3, generator=generator).double()),
        shape=cloud * 2,
    )
