# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""CAD meshes as they are and in other proportions: of split `train` to train on, `test` to test."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from experiments.mesh_credits import rows_of

COPY_STRETCH = 0.2
_STRETCH = np.array((0.12, 0.08, 0.08))
_PARTS = ((4, 0.25), (1, 0.0), (3, 0.15))  # along each axis: how many, and the spread of their logs


@dataclass(frozen=True)
class Sizes:
    """Length, width and height of road vehicles; how many copies; whether any length will do."""

    share: int
    least_m: tuple[float, float, float]
    most_m: tuple[float, float, float]
    any_length: bool = False


ROAD_SIZES = {
    "car": Sizes(1, (3.4, 1.5, 1.1), (5.3, 2.1, 2.1)),
    "truck": Sizes(2, (5.0, 1.9, 1.9), (12.0, 2.6, 4.0), any_length=True),
    "bus": Sizes(4, (7.0, 2.3, 2.7), (13.0, 2.6, 4.3), any_length=True),
}


def train_split(cad: Path, categories: tuple[str, ...]) -> list[dict[str, str]]:
    """The rows of these categories that weights may be made from."""
    return [row for row in rows_of(cad, "train") if row["category"] in categories]


def road_vehicles(cad: Path, into: Path, count: int, seed: int) -> None:
    """Write `count` vehicles of the train split, lorries and buses oftener than cars, shuffled.

    A mesh's first copy is as it is. The others are stretched, their parts of other lengths, and
    of sizes that are seen on roads, for many models are toys.
    """
    import trimesh

    rows = train_split(cad, tuple(ROAD_SIZES))
    files = [row for row in rows for _ in range(ROAD_SIZES[row["category"]].share)]
    rng = np.random.default_rng(seed)
    drawn = [files[i] for _ in range(-(-count // len(files))) for i in rng.permutation(len(files))]
    seen: set[str] = set()
    for place, row in enumerate(drawn[:count]):
        name, sizes = row["file"], ROAD_SIZES[row["category"]]
        mesh = trimesh.load(cad / name, force="mesh", process=False)
        if name in seen:
            mesh.vertices = warped(np.asarray(mesh.vertices), sizes, rng)
        seen.add(name)
        mesh.export(into / f"{place:04d}_{Path(name).stem}.ply")


def unseen_vehicles(cad: Path, into: Path) -> None:
    """Write the vehicles of split `test`, each once, stretched to a size that is seen on roads."""
    import trimesh

    into.mkdir(parents=True, exist_ok=True)
    for row in rows_of(cad, "test"):
        if row["category"] not in ROAD_SIZES:
            continue
        sizes = ROAD_SIZES[row["category"]]
        mesh = trimesh.load(cad / row["file"], force="mesh", process=False)
        size = np.ptp(mesh.vertices, axis=0)
        mesh.vertices = mesh.vertices * (np.clip(size, sizes.least_m, sizes.most_m) / size)
        mesh.export(into / f"{row['category']}_{Path(row['file']).stem}.ply")


def warped(vertices: np.ndarray, sizes: Sizes, rng: np.random.Generator) -> np.ndarray:
    """Vertices (N, 3) of another vehicle: stretched, and its parts of other lengths."""
    size = np.ptp(vertices, axis=0) * rng.uniform(1 - _STRETCH, 1 + _STRETCH)
    if sizes.any_length:
        size[0] = rng.uniform(sizes.least_m[0], sizes.most_m[0])
    size = np.clip(size, sizes.least_m, sizes.most_m)
    return _other_parts(vertices, rng) * size - (size[0] / 2, size[1] / 2, 0.0)


def _other_parts(vertices: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Vertices (N, 3) in their box, 0 to 1, the parts along each axis of other lengths."""
    low, size = vertices.min(0), np.maximum(np.ptp(vertices, axis=0), 1e-9)
    out = np.empty_like(vertices, dtype=np.float64)
    for axis, (knots, spread) in enumerate(_PARTS):
        share = np.exp(rng.uniform(-spread, spread, knots))
        edges = np.concatenate(((0.0,), np.cumsum(share) / share.sum()))
        place = (vertices[:, axis] - low[axis]) / size[axis]
        out[:, axis] = np.interp(place, np.linspace(0, 1, knots + 1), edges)
    return out


def stretched(cad: Path, into: Path, category: str, copies: int, seed: int) -> int:
    """Write a category's meshes of the train split and stretched copies, shuffled; the meshes."""
    import trimesh

    files = [cad / row["file"] for row in train_split(cad, (category,))]
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(files) * copies)
    for number, place in enumerate(order):
        copy, index = divmod(number, len(files))
        mesh = trimesh.load(files[index], force="mesh", process=False)
        factors = rng.uniform(1 - COPY_STRETCH, 1 + COPY_STRETCH, 3) if copy else np.ones(3)
        mesh.vertices = np.asarray(mesh.vertices) * factors
        mesh.export(into / f"{place:04d}_{files[index].stem}.ply")
    return len(files)
