# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Renders of a chair in the layout of DPC's data folder, as DRC's renderer writes them."""

import numpy as np
from PIL import Image
from scipy.io import savemat
from tests.datasets.unit_scene import look_at, rendering, surface

SYNSET = "03001627"
render = rendering()


def write_data(
    root, models=("a1", "b2", "c3"), splits=("train", "val", "test"), views=5, **options
):
    """`renders`, `splits` and `gt` with one model a split; returns T_camera_world by model."""
    poses = {}
    for number, (model, split) in enumerate(zip(models, splits, strict=True)):
        poses[model] = write_model(root, model, views, seed=number, **options)
        write_list(root, split, [model])
        write_truth(root, model)
    return poses


def write_list(root, split, models):
    (root / "splits").mkdir(parents=True, exist_ok=True)
    (root / "splits" / f"{SYNSET}_{split}.txt").write_text("\n".join(models) + "\n")


def write_model(root, model, views=5, seed=0, pixels=128, with_K=True, render=render):
    """Views from 2 away, azimuth and elevation in whole degrees as DRC draws them."""
    folder = root / "renders" / SYNSET / model
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    poses = []
    for i in range(views):
        azimuth, elevation = np.radians((rng.integers(-180, 180), rng.integers(-20, 40)))
        flat = 2 * np.cos(elevation)
        eye = np.array((flat * np.cos(azimuth), flat * np.sin(azimuth), 2 * np.sin(elevation)))
        poses.append(look_at(eye))
        write_view(folder, i, poses[-1], eye, pixels, with_K, render)
    return poses


def write_view(folder, number, T_camera_world, eye, pixels, with_K, render=render):
    """A lens of 60 mm before a chip of 32 mm; 16 bits for 0 to 10, cut off, not rounded."""
    focal, middle = 60.0 * pixels / 32.0, pixels / 2
    depth = render(T_camera_world, (focal, focal, middle, middle, pixels, pixels))
    stored = (np.minimum(depth, 10.0) * 65535 / 10).astype(np.uint16)
    Image.fromarray(stored).save(folder / f"depth_{number}.png")
    alpha = np.where(np.isfinite(depth), 255, 0).astype(np.uint8)
    Image.fromarray(np.stack([alpha] * 4, axis=-1)).save(folder / f"render_{number}.png")
    K = np.array([[focal, 0, middle], [0, focal, middle], [0, 0, 1]])
    camera = {"quat": np.zeros(4), "pos": eye, "extrinsic": T_camera_world}
    savemat(folder / f"camera_{number}.mat", camera | ({"K": K} if with_K else {}))


def write_truth(root, model, kind="downsampled"):
    """Points of the OBJ file, whose y is up: (x, y, z) is the renderer's (x, -z, y)."""
    folder = root / "gt" / kind / SYNSET
    folder.mkdir(parents=True, exist_ok=True)
    x, y, z = surface(2000).T
    savemat(folder / f"{model}.mat", {"points": np.stack((x, z, -y), axis=1)})


def picture_scene(root):
    """For docs/datasets: chairs of the simulator's own."""
    from wildshape.simulate.shapes.unit_shapes import chair

    for seed in range(3):
        solid = chair(np.random.default_rng(seed)).centred(1.0)
        write_model(root, f"chair{seed}", seed=seed, render=rendering(solid))
    write_list(root, "train", [f"chair{seed}" for seed in range(3)])
    for split in ("val", "test"):
        write_list(root, split, ["none"])
