# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One scene of a BOP data set: its images, cameras, objects and their models."""

import re
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from wildshape.datasets.rgbd.depth_image import first_size, measured, read_depth_png
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import read_json, reading
from wildshape.io.scans.ply_mesh import read_ply_mesh
from wildshape.records import Intrinsics, Points

_MM = 1e-3
_MOST = 1e9
_IMAGE = re.compile(r"[0-9]{1,9}")


@dataclass(frozen=True)
class Thing:
    """One object in one image.

    Attributes:
        object: its number, that of its model.
        like: which of the same objects in the image, 0 for the first.
        number: in the image's list.
        T_camera_object: x right, y down, z forward; metres.
    """

    object: int
    like: int
    number: int
    T_camera_object: SE3

    @property
    def category(self) -> str:
        """The name of its model."""
        return f"obj_{self.object:06d}"


@dataclass(frozen=True)
class Frame:
    """One image.

    Attributes:
        stem: of its files, six digits.
        camera: pixel i covers [i, i + 1): half a pixel is added to cam_K's principal point.
        metres: of one unit of the depth image.
        T_camera_world: if the data set says so.
    """

    stem: str
    camera: Intrinsics
    metres: float
    things: tuple[Thing, ...]
    T_camera_world: SE3 | None


@dataclass(frozen=True)
class Scene:
    """A folder of images.

    Attributes:
        frames: in the order of their numbers.
        camera: of the first image.
    """

    folder: Path
    frames: tuple[Frame, ...]
    camera: Intrinsics

    def read_depth(self, frame: Frame) -> Float[np.ndarray, "h w"]:
        """The depth of an image, metres, 0 where nothing was measured.

        Raises:
            BadInputError: missing or damaged.
        """
        path = self.folder / "depth" / f"{frame.stem}.png"
        return measured(read_depth_png(path)) * frame.metres


def open_scene(folder: Path) -> Scene:
    """Read scene_camera.json and scene_gt.json.

    Raises:
        BadInputError: one is missing or damaged, or lacks an image of the other.
    """
    cameras = _json(folder / "scene_camera.json", "cam_K and depth_scale of each image")
    truth = _json(folder / "scene_gt.json", "a list of objects of each image")
    keys = sorted(truth, key=int)
    if not keys:
        raise BadInputError(f"{folder / 'scene_gt.json'}: holds no image; take another scene.")
    size = first_size(folder / "depth" / f"{int(key):06d}.png" for key in keys)
    frames = []
    for key in keys:
        if key not in cameras:
            raise BadInputError(
                f"{folder / 'scene_camera.json'}: lacks image {key}; copy it again."
            )
        frames.append(_checked_frame(folder, key, cameras[key], truth[key], size))
    return Scene(folder, tuple(frames), frames[0].camera)


def model_shape(scene: Path, category: str, count: int) -> Points | None:
    """Points `(count, 3)` spread over a model's surface, metres; None where there is no model.

    Raises:
        BadInputError: the model is damaged.
    """
    for above in scene.resolve().parents[:2]:
        for folder in ("models", "models_cad", "models_reconst", "models_eval"):
            path = above / folder / f"{category}.ply"
            with reading(path, "a PLY mesh"):  # the object's number may be too long for a name
                if path.is_file():
                    return _sampled(path, count)
    return None


@lru_cache(maxsize=64)
def _sampled(path: Path, count: int) -> Points:
    import trimesh

    with reading(path, "a PLY mesh"):
        vertices, faces = read_ply_mesh(path)
        if not len(faces):
            raise BadInputError(f"{path}: holds no triangles; export the model as a mesh.")
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        points = trimesh.sample.sample_surface(mesh, count, seed=0)[0]
    return np.asarray(points * _MM, np.float32)


def _checked_frame(folder: Path, key: str, camera: Any, truth: Any, size: tuple[int, int]) -> Frame:
    try:
        with reading(folder, f"BOP's fields of image {key}"):
            return _frame(int(key), camera, truth, size)
    except BadInputError as error:
        where = "" if str(folder) in str(error) else f"{folder}: image {key}: "
        raise BadInputError(f"{where}{error}") from error


def _frame(number: int, camera: Any, truth: Any, size: tuple[int, int]) -> Frame:
    K = np.asarray(camera["cam_K"], np.float64).reshape(3, 3)
    metres = float(camera.get("depth_scale", 1.0)) * _MM
    if not (np.abs(K) <= _MOST).all() or not min(K[0, 0], K[1, 1]) > 0 or not 0 < metres <= _MOST:
        raise ValueError("no camera matrix or depth_scale")
    # BOP takes whole numbers for the pixels' centres.
    intrinsics = Intrinsics(
        K[0, 0].item(), K[1, 1].item(), K[0, 2].item() + 0.5, K[1, 2].item() + 0.5, *size
    )
    seen: Counter[int] = Counter()
    things = []
    for place, entry in enumerate(truth):
        which = entry["obj_id"]
        if not isinstance(which, int):
            raise ValueError(f"obj_id {which!r} is no whole number")
        pose = _pose(entry["cam_R_m2c"], entry["cam_t_m2c"])
        things.append(Thing(which, seen[which], place, pose))
        seen[which] += 1
    world = _pose(camera["cam_R_w2c"], camera["cam_t_w2c"]) if "cam_R_w2c" in camera else None
    return Frame(f"{number:06d}", intrinsics, metres, tuple(things), world)


def _pose(rotation: Any, translation_mm: Any) -> SE3:
    R = np.asarray(rotation, np.float64).reshape(3, 3)
    t = np.asarray(translation_mm, np.float64).reshape(3, 1)
    if not (np.abs(t) <= _MOST).all():
        raise ValueError(f"a pose is {float(np.abs(t).max()):.3g} mm away")
    return SE3.from_matrix(np.concatenate((R, t * _MM), axis=1))


def _json(path: Path, expected: str) -> dict[str, Any]:
    raw = read_json(path, f"JSON with {expected}", dict)
    if not all(_IMAGE.fullmatch(key) for key in raw):
        raise BadInputError(f"{path}: expected {expected}, under the image's number.")
    return raw
