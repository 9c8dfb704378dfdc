# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files that hold nothing but an array: KITTI .bin, .npy, .npz."""

import math
import os
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Num

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise, check_unpacked, reading

_Unpacking = Any  # a zipfile.ZipExtFile; zipfile itself says IO[bytes]
_PIECE_BYTES = 4_000_000
_MOST_COLUMNS = 1000
_LEAST_INTENSITY = -1.0  # some write -1 where there is none
_ROWS = 16  # an array of so many columns and 3 or 4 rows is no scan, but one on its side
_NAMES = ("points", "xyz", "pcd", "arr_0", "data")


def read_kitti_bin(path: Path) -> Float32[np.ndarray, "n 3"]:
    """KITTI's velodyne scans: float32 x y z intensity, little endian, nothing else.

    Of nuScenes (`.pcd.bin`) float32 x y z intensity ring.

    Raises:
        BadInputError: the size is no multiple of a row's, or the rows have another length.
    """
    ring = " ring" if path.name.lower().endswith(".pcd.bin") else ""
    return read_rows(path, f"x y z intensity{ring}")


def read_rows(path: Path, columns: str) -> Float32[np.ndarray, "n 3"]:
    """The x y z of a file of bare float32 rows, little endian.

    `columns`: names of all, x y z intensity first.

    Raises:
        BadInputError: missing, or its size is no multiple of a row's, or 0, or the rows have
            another length.
    """
    rows = _rows(path, columns)
    least = float(np.fmin.reduce(rows[:, 3]))  # of those that are numbers
    if least < _LEAST_INTENSITY:
        raise BadInputError(
            f"{path}: its fourth numbers, {least:.3g} for example, are no intensities: its rows are"
            f" not float32 {columns}; write these, or a single scan as .npy."
        )
    return rows[:, :3]


def _rows(path: Path, columns: str) -> Float32[np.ndarray, "n c"]:
    with reading(path, f"float32 {columns}"), path.open("rb") as file:
        size, width = os.fstat(file.fileno()).st_size, 4 * len(columns.split())
        if size % width or not size:
            raise BadInputError(
                f"{path}: {size} bytes, expected a multiple of {width} (float32 {columns}, a point"
                " a row): truncated or another format; copy or download it again."
            )
        check_promise(path, "points", size // width, size, size)
        return np.fromfile(file, "<f4").reshape(size // width, -1)


def read_npy(path: Path) -> Float[np.ndarray, "n 3"]:
    """An array `(n, 3 or more)` of numbers, or of records with x, y and z; never a pickle.

    Raises:
        BadInputError: another shape or type, or a header that promises more than the file holds.
    """
    with path.open("rb") as file:
        head = file.read(12)
    if head[:6] != b"\x93NUMPY":
        raise BadInputError(f"{path}: expected a numpy array (n, 3), found another kind of file.")
    length = int.from_bytes(head[8:10] if head[6:7] == b"\x01" else head[8:12], "little")
    check_promise(path, "bytes of header", length, length, path.stat().st_size - 10)
    # Mapping compares the promise with the file's size before anything is allocated.
    return _columns(np.load(path, mmap_mode="r", allow_pickle=False), path)


def read_npy_field(path: Path, names: tuple[str, ...]) -> Num[np.ndarray, "n"] | None:
    """The first of these fields of the records of a file that `read_npy` reads; None without."""
    records = np.load(path, mmap_mode="r", allow_pickle=False)
    kinds = {name: field[0].kind for name, field in (records.dtype.fields or {}).items()}
    found = [name for name in names if kinds.get(name, "O") in "fiu"]
    return np.array(records[found[0]]) if found else None


def read_npz(path: Path) -> Float[np.ndarray, "n 3"]:
    """The array named points, xyz, pcd, arr_0 or data, or else the only array of the archive.

    Raises:
        BadInputError: no such array, or a damaged archive.
    """
    with zipfile.ZipFile(path) as archive:
        members = {m.filename.removesuffix(".npy"): m for m in archive.infolist()}
        chosen = next((n for n in _NAMES if n in members), None)
        if chosen is None and len(members) == 1:
            chosen = next(iter(members))
        if chosen is None:
            raise BadInputError(
                f"{path}: expected one array, or one named {', '.join(_NAMES)}; found "
                f"{sorted(members)[:8]}."
            )
        info = members[chosen]
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BadInputError(
                f"{path}: is packed in another way than numpy's; write it with savez_compressed."
            )
        check_unpacked(path, info.file_size, info.compress_size)
        with archive.open(info) as file:
            return _read_member(file, info.file_size, path)


def read_npz_arrays(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Those of the named arrays of real numbers that an archive holds.

    Raises:
        BadInputError: a damaged archive, or an array of another kind.
    """
    found = {}
    with zipfile.ZipFile(path) as archive:
        for name in set(names) & {m.removesuffix(".npy") for m in archive.namelist()}:
            info = archive.getinfo(f"{name}.npy")
            check_unpacked(path, info.file_size, info.compress_size)
            with archive.open(info) as file:
                shape, is_fortran, dtype = _npy_header(file, info.file_size, path)
                if dtype.kind not in "fiu":
                    raise BadInputError(f"{path}: {name} holds {dtype}, expected numbers.")
                data = _exactly(file, math.prod(shape) * dtype.itemsize, path)
                order = "F" if is_fortran else "C"
                found[name] = np.frombuffer(data, dtype).reshape(shape, order=order)
                file.read(1)  # to the end: only there the checksum is compared
    return found


def _read_member(file: _Unpacking, size: int, path: Path) -> Float[np.ndarray, "n 3"]:
    """The x y z of an array in an archive, unpacked piece by piece: the rest is never held."""
    shape, is_fortran, dtype = _npy_header(file, size, path)
    _check_shape(shape, dtype, path)
    if is_fortran and len(shape) == 2:
        columns = [np.frombuffer(_exactly(file, shape[0] * dtype.itemsize, path), dtype)]
        columns += [
            np.frombuffer(_exactly(file, shape[0] * dtype.itemsize, path), dtype) for _ in "yz"
        ]
        points = np.stack(columns, -1).astype(_kind(dtype))
    else:
        points = np.concatenate(list(_pieces(file, shape, dtype, path)))
    while file.read(_PIECE_BYTES):
        pass  # to the end: only there the checksum is compared
    return points


def _pieces(
    file: _Unpacking, shape: tuple[int, ...], dtype: np.dtype, path: Path
) -> Iterator[Float[np.ndarray, "n 3"]]:
    width = math.prod(shape[1:])
    rows = max(1, _PIECE_BYTES // (width * dtype.itemsize))
    yield np.empty((0, 3), _kind(dtype))
    for start in range(0, shape[0], rows):
        count = min(rows, shape[0] - start)
        piece = np.frombuffer(_exactly(file, count * width * dtype.itemsize, path), dtype)
        yield _columns(piece.reshape(count, *shape[1:]), path)


def _exactly(file: _Unpacking, size: int, path: Path) -> bytes:
    data = file.read(size)
    if len(data) < size:
        raise BadInputError(f"{path}: ends before its array does: truncated; copy it again.")
    return data


def _npy_header(
    file: _Unpacking, size: int, path: Path
) -> tuple[tuple[int, ...], bool, np.dtype[np.generic]]:
    version = np.lib.format.read_magic(file)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    shape, is_fortran, dtype = read[version](file)
    count = int(np.prod([int(n) for n in shape], dtype=object))
    check_promise(path, "numbers", count, count * dtype.itemsize, size)
    return shape, is_fortran, dtype


def _check_shape(shape: tuple[int, ...], dtype: np.dtype[np.generic], path: Path) -> None:
    """Refuse what is no array of points, before it is read."""
    if _has_axes(dtype) and len(shape) == 1:
        return
    if len(shape) == 2 and shape[0] in (3, 4) and shape[1] >= _ROWS:
        raise BadInputError(
            f"{path}: is an array {shape[0]} x {shape[1]}, a point a column, but a point must be a"
            " row; save its transpose, points.T."
        )
    if len(shape) != 2 or not 3 <= shape[1] <= _MOST_COLUMNS or dtype.kind not in "fiu":
        raise BadInputError(
            f"{path}: expected an array of numbers (n, 3), found {dtype} {shape}; save "
            "x y z as columns."
        )
    check_promise(path, "points", shape[0], 0, 0)


def _has_axes(dtype: np.dtype[np.generic]) -> bool:
    kinds = {name: field[0].kind for name, field in (dtype.fields or {}).items()}
    return all(kinds.get(axis, "O") in "fiu" for axis in "xyz")


def _kind(dtype: np.dtype[np.generic]) -> type[np.floating]:
    """float32 only for what is no wider."""
    return np.float32 if dtype.kind == "f" and dtype.itemsize <= 4 else np.float64


def _columns(array: np.ndarray, path: Path) -> Float[np.ndarray, "n 3"]:
    """The x y z of an array, in its own precision."""
    _check_shape(array.shape, array.dtype, path)
    if array.dtype.names:
        array = np.stack([array["x"], array["y"], array["z"]], -1)
    return np.array(array[:, :3], _kind(array.dtype))
