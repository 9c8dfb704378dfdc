# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers of scans, and of what lies beside scans in a track folder."""

import io
import json
import struct
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import torch
from tests.fuzz.target import Arrays, Target, numbers_of, only_file
from tests.io.ply_with_lists import ply_with_lists

from wildshape.cli.pipe import as_file
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.inputs import open_tracks
from wildshape.io.poses import read_poses, read_tum, write_poses, write_tum
from wildshape.io.scans.points import check_scan, read_points
from wildshape.io.tracks import read_info, read_track_file, write_track
from wildshape.records import Intrinsics, Sensor, Track

CLOUD = np.random.default_rng(7).normal((6, 1, 0), size=(24, 3)).astype(np.float32)
"""`(24, 3)`, a few metres across."""


def _put(folder: Path, name: str, data: bytes) -> None:
    folder.mkdir(parents=True)
    (folder / name).write_bytes(data)


def _plain_ply(order: str) -> bytes:
    head = f"ply\nformat {order} 1.0\nelement vertex {len(CLOUD)}\nproperty float x\n"
    head += "property float y\nproperty float z\nproperty uchar intensity\nend_header\n"
    if order == "ascii":
        return (head + "".join(f"{x} {y} {z} 7\n" for x, y, z in CLOUD)).encode()
    sign = "<" if "little" in order else ">"
    return head.encode() + b"".join(struct.pack(sign + "fffB", *row, 7) for row in CLOUD)


def _build_ply(folder: Path) -> None:
    for order in ("ascii", "binary_little_endian", "binary_big_endian"):
        _put(folder / order, "scan.ply", _plain_ply(order))
        _put(folder / f"{order}_lists", "scan.ply", ply_with_lists(order, CLOUD))


def _build_pcd(folder: Path) -> None:
    from pypcd4.pypcd4 import Encoding, PointCloud

    points = PointCloud.from_xyzi_points(np.hstack([CLOUD, CLOUD[:, :1]]))
    for encoding in ("ascii", "binary", "binary_compressed"):
        (folder / encoding).mkdir(parents=True)
        points.save(folder / encoding / "scan.pcd", Encoding(encoding))


def _build_bin(folder: Path) -> None:
    rows = np.hstack([CLOUD, np.abs(CLOUD[:, :1])]).astype("<f4")
    _put(folder / "kitti", "scan.bin", rows.tobytes())


def _build_npy(folder: Path) -> None:
    named = np.zeros(len(CLOUD), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "u1")])
    for i, axis in enumerate("xyz"):
        named[axis] = CLOUD[:, i]
    for name, array in (("plain", CLOUD), ("named", named), ("fortran", np.asfortranarray(CLOUD))):
        (folder / name).mkdir(parents=True)
        np.save(folder / name / "scan.npy", array)


def _build_npz(folder: Path) -> None:
    for name, save in (("stored", np.savez), ("packed", np.savez_compressed)):
        (folder / name).mkdir(parents=True)
        save(folder / name / "scan.npz", points=CLOUD, other=CLOUD[:3])
    (folder / "only").mkdir()
    np.savez(folder / "only" / "scan.npz", CLOUD.astype(np.float64))


def _build_text(folder: Path) -> None:
    rows = [" ".join(f"{value:.6f}" for value in row) for row in CLOUD]
    commas = [row.replace(" ", ",") + ",7,0" for row in rows]
    _put(folder / "xyz", "scan.xyz", "\n".join(rows).encode())
    _put(folder / "txt", "scan.txt", "\n".join(["# x y z", *rows, ""]).encode())
    _put(folder / "csv", "scan.csv", "\n".join(["x,y,z,intensity,ring", *commas]).encode())
    units = ["X (m),Y (m),Z (m),intensity,ring", *commas]
    _put(folder / "units", "scan.csv", "\n".join(units).encode())
    semicolons = [row.replace(" ", ";") for row in rows]
    _put(folder / "semicolons", "scan.csv", "\n".join(["x;y;z", *semicolons]).encode())


def _build_las(folder: Path, suffix: str) -> None:
    import laspy

    for kind, version in ((0, "1.2"), (3, "1.2"), (6, "1.4"), (7, "1.4")):
        header = laspy.LasHeader(point_format=kind, version=version)
        header.scales = np.full(3, 1e-4)
        if kind == 3:
            header.vlrs.append(laspy.VLR("someone", 7, "a record", b"x" * 20))
        data = laspy.LasData(header)
        data.xyz = CLOUD.astype(np.float64)
        (folder / f"format{kind}").mkdir(parents=True)
        data.write(str(folder / f"format{kind}" / f"scan.{suffix}"))


def read_scan(folder: Path) -> Arrays:
    """A scan file, in metres and in millimetres, and what all scans pass."""
    path = only_file(folder)
    points = read_points(path)
    yield points
    check_scan(points, str(path))


def _build_piped(folder: Path) -> None:
    _build_npy(folder)
    _put(folder / "ply", "scan", _plain_ply("ascii"))
    _put(folder / "text", "scan", "\n".join(f"{x} {y} {z}" for x, y, z in CLOUD).encode())
    for path in folder.glob("*/scan.*"):
        path.rename(path.with_suffix(""))
    for build, name in ((_build_pcd, "pcd"), (_build_npz, "npz")):
        build(folder / name)
        for i, path in enumerate(sorted((folder / name).glob("*/*"))):
            _put(folder / f"{name}{i}", "scan", path.read_bytes())
            path.unlink()
            path.parent.rmdir()
        (folder / name).rmdir()


def _read_piped(folder: Path) -> Arrays:
    path = only_file(folder)
    stdin = io.TextIOWrapper(io.BytesIO(path.read_bytes() if path.is_file() else b""))
    with mock.patch.object(sys, "stdin", stdin), as_file(Path("-"), "auto") as path:
        yield read_points(path)


def track() -> Track:
    """Two scans with poses, a shape and a camera."""
    angle = torch.tensor([0.1, 0.2], dtype=torch.float64)
    rotation = torch.eye(3, dtype=torch.float64).repeat(2, 1, 1)
    rotation[:, 0, 0] = rotation[:, 1, 1] = angle.cos()
    rotation[:, 0, 1], rotation[:, 1, 0] = -angle.sin(), angle.sin()
    return Track(
        name="car",
        scans=(CLOUD.astype(np.float32), CLOUD[:20].astype(np.float32)),
        scan_names=("000000", "000001"),
        sensor=Sensor("camera", None, Intrinsics(100.5, 100.5, 64.0, 64.0, 128, 128)),
        category="car",
        source="a test",
        T_sensor_object=SE3(rotation, torch.ones(2, 3, dtype=torch.float64)),
        shape=CLOUD.astype(np.float32) * 2,
    )


def _poses() -> SE3:
    found = track().T_sensor_object
    assert found is not None
    return found


def _build_poses(folder: Path) -> None:
    (folder / "poses").mkdir(parents=True)
    write_poses(folder / "poses" / "poses.txt", _poses())


def _read_poses(folder: Path) -> Arrays:
    yield read_poses(only_file(folder)).matrix.numpy()


def _build_tum(folder: Path) -> None:
    (folder / "tum").mkdir(parents=True)
    write_tum(folder / "tum" / "poses.tum.txt", _poses(), [0, 1])


def _read_tum(folder: Path) -> Arrays:
    times, poses = read_tum(only_file(folder))
    yield np.array(times)
    yield poses.matrix.numpy()


def _build_info(folder: Path) -> None:
    camera = {"fx": 9.5, "fy": 9.5, "cx": 4.0, "cy": 4.0, "width": 8, "height": 8}
    texts = (
        {"sensor": "lidar", "resolution_deg": [0.2, 0.4], "category": "car", "unit": "mm"},
        {"sensor": "camera", "intrinsics": camera, "source": "x", "unit": "m"},
    )
    for i, text in enumerate(texts):
        _put(folder / f"info{i}", "track.json", json.dumps(text).encode())


def _read_info(folder: Path) -> Arrays:
    sensor = read_info(folder / "track.json")["sensor"]
    yield np.array(sensor.resolution_deg or ())
    lens = sensor.intrinsics
    if lens is not None:
        yield np.array((lens.fx, lens.fy, lens.cx, lens.cy, lens.width, lens.height), float)


def _build_track(folder: Path) -> None:
    write_track(folder / "camera" / "car", track())
    for name in ("a", "b"):
        _put(
            folder / "plain" / name / "scans",
            "0.xyz",
            b"\n".join(b"%d 1 %d" % (i, i) for i in range(20)),
        )
        (folder / "plain" / name / "track.json").write_text('{"unit": "cm"}')


def _read_track(folder: Path) -> Arrays:
    for place in sorted(folder.iterdir()):
        yield from numbers_of(read_track_file(place).track)
    source = open_tracks(folder)
    for found in source:
        yield from numbers_of(found)


TARGETS = (
    Target("ply", _build_ply, read_scan, 2.5),
    Target("pcd", _build_pcd, read_scan, 2),
    Target("bin", _build_bin, read_scan, 0.3),
    Target("npy", _build_npy, read_scan, 1.5),
    Target("npz", _build_npz, read_scan, 2),
    Target("text", _build_text, read_scan, 2.5),
    Target("las", lambda folder: _build_las(folder, "las"), read_scan, 2),
    Target("laz", lambda folder: _build_las(folder, "laz"), read_scan, 3),
    Target("piped", _build_piped, _read_piped, 1.5),
    Target("poses", _build_poses, _read_poses, 0.7),
    Target("tum", _build_tum, _read_tum, 0.7),
    Target("track-json", _build_info, _read_info, 1),
    Target("track-folder", _build_track, _read_track, 1),
)

__all__ = ["CLOUD", "TARGETS", "read_scan", "track"]
