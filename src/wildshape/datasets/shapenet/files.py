# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The files of DPC's ShapeNet renders: depth, camera, lists of models, true points.

Written by the renderer of DRC (Tulsiani et al. 2017), which DPC used.
"""

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float

from wildshape.datasets.rgbd.depth_image import read_depth_png
from wildshape.datasets.shapenet.matlab import read_matrices
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Intrinsics, Points

_FARTHEST, _STEPS = 10.0, 65535  # depth 0 to 10 in 16 bits; the last step is the background
_FOCAL = 60.0 / 32.0  # in image widths: a lens of 60 mm before a chip of 32 mm
_MOST = 1e9
_LEAST = 1e-3  # pixels: a shorter focal length is none
_MODEL = re.compile(r"[\w.-]{1,200}", re.ASCII)
_NAME = re.compile(r"depth_(\d+)\.png")


@dataclass(frozen=True)
class View:
    """One rendered depth image.

    Attributes:
        name: stem of its file.
        depth: along the optical axis, in units of the model; infinite where nothing is.
        camera: pixel i covers [i, i + 1).
        T_camera_world: x right, y down, z forward; from the renderer's world.
    """

    name: str
    depth: Float[np.ndarray, "h w"]
    camera: Intrinsics
    T_camera_world: SE3


def read_view(path: Path) -> View:
    """A depth image and the `camera_N.mat` beside it.

    Raises:
        BadInputError: one of the two is missing or damaged.
    """
    number = _NAME.fullmatch(path.name)
    if number is None:
        raise BadInputError(f"{path}: expected a name such as depth_0.png.")
    raw = read_depth_png(path)
    depth = np.where(raw < _STEPS, raw * (_FARTHEST / _STEPS), np.inf)
    cam = path.with_name(f"camera_{number[1]}.mat")
    found = _matrices(cam, ("extrinsic", "K"))
    if found.get("extrinsic", np.zeros(0)).shape != (4, 4):
        raise BadInputError(f"{cam}: lacks 'extrinsic' (4 x 4); download the renders again.")
    try:
        T_camera_world = SE3.from_matrix(found["extrinsic"].astype(np.float64))
    except BadInputError as error:
        raise BadInputError(f"{cam}: extrinsic: {error}") from error
    return View(path.stem, depth, _camera(found.get("K"), raw.shape, cam), T_camera_world)


def read_model_list(path: Path) -> list[str]:
    """The models of a split, in the list's order.

    Raises:
        BadInputError: no such file, or something else in it.
    """
    if not path.is_file():
        raise BadInputError(
            f"{path}: no such file; copy the folder data/splits of DPC's repository there."
        )
    about = path.stat()
    return _models_of(path, about.st_size, about.st_mtime_ns)


@lru_cache(maxsize=8)
def _models_of(path: Path, size: int, changed_ns: int) -> list[str]:  # noqa: ARG001
    """The list is read once for all parts that are made of it, and anew where it has changed."""
    models = path.read_text("utf-8", errors="replace").split()
    wrong = next((model for model in models if not _MODEL.fullmatch(model)), None)
    if wrong is not None or not models:
        raise BadInputError(f"{path}: expected a model a line, found {wrong or 'nothing'!r}.")
    if len(set(models)) < len(models):
        raise BadInputError(f"{path}: lists a model twice; copy the folder data/splits again.")
    return models


def read_shape(truth: Path, synset: str, model: str) -> Points | None:
    """Surface points of a model in the renderer's world; None where nobody sampled them.

    Raises:
        BadInputError: the file is damaged.
    """
    files = [truth / kind / synset / f"{model}.mat" for kind in ("downsampled", "dense")]
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        return None
    points = _matrices(file, ("points",)).get("points", np.zeros(0))
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise BadInputError(f"{file}: lacks 'points' (n x 3); download or sample it again.")
    # Blender imports an OBJ file with y up and -z forward.
    x, y, z = points.T
    return np.stack((x, -z, y), axis=1).astype(np.float32)


def _matrices(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    arrays = read_matrices(path, names)
    wrong = next((name for name, array in arrays.items() if not _is_finite(array)), None)
    if wrong is not None:
        raise BadInputError(f"{path}: {wrong} holds what is no number; download it again.")
    return arrays


def _is_finite(array: np.ndarray) -> bool:
    return array.dtype.kind in "fiu" and bool((np.abs(array.astype(np.float64)) <= _MOST).all())


def _camera(K: np.ndarray | None, shape: tuple[int, ...], path: Path) -> Intrinsics:
    """The intrinsics of an image of `shape`, whatever size `K` was written for."""
    height, width = shape
    if K is None:
        return Intrinsics(_FOCAL * width, _FOCAL * width, width / 2, height / 2, width, height)
    if K.shape != (3, 3) or not (np.isfinite(K).all() and min(K[0, 0], K[1, 1], K[0, 2]) > _LEAST):
        raise BadInputError(f"{path}: K is no camera matrix (3 x 3); download the renders again.")
    scale = width / (2 * float(K[0, 2]))  # the principal point is the image's middle
    fx, fy, cx, cy = (float(scale * v) for v in (K[0, 0], K[1, 1], K[0, 2], K[1, 2]))
    return Intrinsics(fx, fy, cx, cy, width, height)
