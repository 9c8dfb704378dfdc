# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Files that hold nothing but an array: KITTI .bin, .npy, .npz."""

import io
import zipfile
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.errors import BadInputError
from wildshape.io.guard import check_promise

_DEFLATE_RATIO = 1100  # deflate cannot shrink more than 1032 times
_NPY_HEADER = 16384  # bytes; longer headers are refused
_NAMES = ("points", "xyz", "pcd", "arr_0", "data")


def read_kitti_bin(path: Path) -> Float[np.ndarray, "n 3"]:
    """KITTI's velodyne scans: float32 x y z intensity, little endian, nothing else.

    Raises:
        BadInputError: the size is no multiple of 16 bytes.
    """
    size = path.stat().st_size
    if size % 16:
        raise BadInputError(
            f"{path}: expected 16 bytes a point (KITTI: float32 x y z intensity), found "
            f"{size} bytes, "
            "which 16 does not divide: truncated or another format."
        )
    check_promise(path, "points", size // 16, size, size)
    return np.fromfile(path, "<f4").reshape(-1, 4)[:, :3]


def read_npy(path: Path) -> Float[np.ndarray, "n 3"]:
    """An array `(n, 3 or more)` of numbers, or of records with x, y and z; never a pickle.

    Raises:
        BadInputError: another shape or type, or a header that promises more than the file holds.
    """
    with path.open("rb") as file:
        if file.read(6) != b"\x93NUMPY":
            raise BadInputError(
                f"{path}: expected a numpy array (n, 3), found another kind of file."
            )
    # Mapping compares the promise with the file's size before anything is allocated.
    return _columns(np.load(path, mmap_mode="r", allow_pickle=False), path)


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
        check_promise(
            path, "unpacked bytes", 0, info.file_size, _DEFLATE_RATIO * (info.compress_size + 64)
        )
        with archive.open(info) as file:
            _check_npy_header(io.BytesIO(file.read(_NPY_HEADER)), info.file_size, path)
        with archive.open(info) as file:
            array = np.lib.format.read_array(file, allow_pickle=False)
            file.read()  # to the end: only there the checksum is compared
        return _columns(array, path)


def _check_npy_header(file: io.BytesIO, size: int, path: Path) -> None:
    version = np.lib.format.read_magic(file)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    shape, _, dtype = read[version](file)
    count = int(np.prod([int(n) for n in shape], dtype=object))
    check_promise(path, "numbers", count, count * dtype.itemsize, size - file.tell())


def _columns(array: np.ndarray, path: Path) -> Float[np.ndarray, "n 3"]:
    """The x y z of an array, in its own precision."""
    if array.dtype.names and {"x", "y", "z"} <= set(array.dtype.names) and array.ndim == 1:
        array = np.stack([array["x"], array["y"], array["z"]], -1)
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise BadInputError(
            f"{path}: expected an array of numbers (n, 3), found {array.dtype} {array.shape}; save "
            "x y z as columns."
        )
    check_promise(path, "points", len(array), 0, 0)
    kind = np.float32 if array.dtype.itemsize <= 4 and array.dtype.kind == "f" else np.float64
    return np.array(array[:, :3], kind)
