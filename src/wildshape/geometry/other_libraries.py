# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points as objects of other libraries, each imported when it is asked for."""

from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from wildshape.errors import MissingExtraError

if TYPE_CHECKING:
    import laspy
    import trimesh

_LAS_STEP_M = 1e-4


def load_open3d() -> ModuleType:
    """The library.

    Raises:
        MissingExtraError: it is not installed, or a library of the system that it needs is not.
    """
    try:
        return import_module("open3d")
    except ModuleNotFoundError as error:
        raise MissingExtraError(
            f"Open3D is not installed ({error}): pip install 'wildshape[open3d]'."
        ) from error
    except (ImportError, OSError) as error:
        raise MissingExtraError(
            f"Open3D is installed but does not load ({error}): install the system library that it"
            " names (on Debian and Ubuntu: apt install libgl1 libegl1 libx11-6 libusb-1.0-0)."
        ) from error


def open3d_cloud(points: Float[np.ndarray, "n 3"]) -> Any:
    """An `open3d.geometry.PointCloud`.

    Raises:
        MissingExtraError: Open3D is not installed.
    """
    open3d = load_open3d()
    rows = open3d.utility.Vector3dVector(np.asarray(points, np.float64))
    return open3d.geometry.PointCloud(rows)


def trimesh_cloud(points: Float[np.ndarray, "n 3"]) -> "trimesh.PointCloud":
    """A `trimesh.PointCloud`."""
    import trimesh

    return trimesh.PointCloud(np.asarray(points, np.float64))


def las_cloud(points: Float[np.ndarray, "n 3"]) -> "laspy.LasData":
    """A `laspy.LasData`, a tenth of a millimetre fine."""
    import laspy

    header = laspy.LasHeader(point_format=0)
    header.scales = np.full(3, _LAS_STEP_M)
    # Whole numbers about the cloud's place: 32 bits would not reach far from the origin.
    header.offsets = np.floor(points.min(0)).astype(np.float64) if len(points) else np.zeros(3)
    held = laspy.LasData(header)
    held.x, held.y, held.z = np.asarray(points, np.float64).T
    return held
