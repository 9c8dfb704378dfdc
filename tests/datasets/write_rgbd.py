# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Two chairs before a wall, seen by a depth camera: as RGB-D frames with masks, and as BOP.

Metres; OpenCV's pixels, whose centres are whole numbers. A third of a chair's size is enough for
the millimetre to be a hard bar.
"""

import json

import numpy as np
from PIL import Image
from tests.datasets.street import rigid
from tests.datasets.unit_scene import CHAIR, look_at, render, rendering

CAMERA = {"fx": 140.0, "fy": 143.0, "cx": 78.7, "cy": 61.2, "width": 160, "height": 120}
WALL = (((-9.0, 2.0, -9.0), (9.0, 2.1, 9.0)),)
THINGS = {1: rigid(-0.45, 0.1, 0.0, yaw=0.5), 2: rigid(0.45, -0.1, 0.1, yaw=-1.2)}
"""T_world_object of the chairs that stand."""


def camera_poses(count):
    """`T_camera_world` along a quarter circle before the wall."""
    angles = np.linspace(-0.9, 0.9, count)
    return [look_at((1.6 * np.sin(a), -1.6 * np.cos(a), 0.5 + 0.1 * a)) for a in angles]


def frame(T_camera_world, things=None, camera=None, solid=None):
    """Depth `(h, w)` metres, and instance numbers."""
    camera, draw = camera or CAMERA, rendering(solid)
    lens = (camera["fx"], camera["fy"], camera["cx"] + 0.5, camera["cy"] + 0.5)
    lens += (camera["width"], camera["height"])
    depth = render(T_camera_world, lens, WALL)
    ids = np.zeros(depth.shape, np.uint16)
    for number, T_world_object in (THINGS if things is None else things).items():
        seen = draw(T_camera_world @ T_world_object, lens)
        ids[seen < depth] = number
        depth = np.minimum(depth, seen)
    return np.where(np.isfinite(depth), depth, 0.0), ids


def moving(number, count):
    """`T_world_object` of the chairs in frame `number`: the second slides 1.5 m."""
    slid = THINGS[2].copy()
    slid[0, 3] = 0.75 - 1.5 * number / max(count - 1, 1)
    return {1: THINGS[1], 2: slid}


def write_png(path, pixels):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path)


def write_sequence(
    folder, count=5, scale=10000.0, *, apart=False, poses=True, moves=False, camera=None, solid=None
):
    """A sequence of RGB-D frames; masks together, or `apart` in a folder an instance."""
    T_camera_world = camera_poses(count)
    for i, T in enumerate(T_camera_world):
        depth, ids = frame(T, moving(i, count) if moves else None, camera, solid)
        write_png(folder / "depth" / f"{i:06d}.png", np.round(depth * scale).astype(np.uint16))
        if not apart:
            write_png(folder / "masks" / f"{i:06d}.png", ids)
        for number in THINGS if apart else ():
            mask = np.where(ids == number, 255, 0).astype(np.uint8)
            write_png(folder / "masks" / str(number) / f"{i:06d}.png", mask)
    (folder / "camera.json").write_text(json.dumps((camera or CAMERA) | {"depth_scale": scale}))
    (folder / "objects.json").write_text(json.dumps({"1": "chair", "2": "stool"}))
    if poses:
        rows = [np.linalg.inv(T)[:3].ravel() for T in T_camera_world]
        text = "\n".join(" ".join(f"{v:.9f}" for v in row) for row in rows)
        (folder / "poses.txt").write_text(text + "\n")
    return T_camera_world


def write_bop(root, count=4, scale=0.1, *, world=False, camera=None, solid=None):
    """A scene in the BOP format: obj_000007 twice; millimetres; returns T_camera_world."""
    folder, lens = root / "test" / "000001", camera or CAMERA
    T_camera_world = camera_poses(count)
    cameras, truth = {}, {}
    K = [lens["fx"], 0, lens["cx"], 0, lens["fy"], lens["cy"], 0, 0, 1]
    for i, T in enumerate(T_camera_world):
        depth, ids = frame(T, None, camera, solid)
        pixels = np.round(depth * 1000 / scale).astype(np.uint16)
        write_png(folder / "depth" / f"{i:06d}.png", pixels)
        cameras[str(i)] = {"cam_K": K, "depth_scale": scale}
        if world:
            cameras[str(i)] |= pose_fields(T, "w2c")
        truth[str(i)] = []
        for place, (number, T_world_object) in enumerate(THINGS.items()):
            truth[str(i)].append({"obj_id": 7} | pose_fields(T @ T_world_object, "m2c"))
            mask = np.where(ids == number, 255, 0).astype(np.uint8)
            write_png(folder / "mask_visib" / f"{i:06d}_{place:06d}.png", mask)
    (folder / "scene_camera.json").write_text(json.dumps(cameras))
    (folder / "scene_gt.json").write_text(json.dumps(truth))
    return T_camera_world


def pose_fields(T, name):
    """Rotation row by row, translation in millimetres."""
    return {
        f"cam_R_{name}": T[:3, :3].ravel().tolist(),
        f"cam_t_{name}": (1000 * T[:3, 3]).tolist(),
    }


def write_model(root):
    """The chair's mesh, millimetres."""
    import trimesh

    boxes = [trimesh.creation.box(bounds=1000 * np.asarray(corners)) for corners in CHAIR]
    (root / "models").mkdir(parents=True, exist_ok=True)
    trimesh.util.concatenate(boxes).export(root / "models" / "obj_000007.ply")


def picture_scene(root):
    """For docs/datasets: a chair of the simulator's own, twice."""
    write_sequence(root / "kitchen", count=9, camera=_LARGE, solid=_chair())


def picture_bop(root):
    """For docs/datasets."""
    write_bop(root, count=9, camera=_LARGE, solid=_chair())


_LARGE = {"fx": 560.0, "fy": 560.0, "cx": 319.2, "cy": 239.6, "width": 640, "height": 480}


def _chair():
    from wildshape.simulate.shapes.unit_shapes import chair

    return chair(np.random.default_rng(1)).centred(1.0)
