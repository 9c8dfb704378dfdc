# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The presets: functions that return a `Recipe`. Change one with `dataclasses.replace`."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from wildshape.errors import BadInputError
from wildshape.geometry.projection.visibility import FacingBins, PixelBins, PolarBins
from wildshape.io.store.store import Store
from wildshape.method.encoders.named import Backbone
from wildshape.method.multiview import LossConfig
from wildshape.method.network import NetworkConfig
from wildshape.method.ray_encoder import RayConfig
from wildshape.records import SensorKind
from wildshape.training.batches.fused import DrawConfig
from wildshape.training.batches.occlusion_augmentation import OcclusionConfig
from wildshape.training.batches.views import ViewConfig
from wildshape.training.config import OptimConfig, Recipe, stretched
from wildshape.training.self_training.objective import TaughtLossConfig


def paper_lidar() -> Recipe:
    """The paper's numbers for LiDAR vehicles (section 5.4, METHOD 3 to 6)."""
    return Recipe(
        name="paper-lidar",
        network=NetworkConfig(points=2048, branches=4, spread="yaw"),
        loss=LossConfig(beta=0.05, projection=PolarBins(0.02, 0.02)),
        views=ViewConfig(tracks=8, views=4, points=1024, window=20, sensor="lidar"),
        optim=OptimConfig(steps=400_000, lr=1e-4, decay=0.7, decay_every=100_000),
    )


def paper_views() -> Recipe:
    """The paper's numbers for depth views of ShapeNet (section 5.4)."""
    return Recipe(
        name="paper-views",
        network=NetworkConfig(points=2048, branches=4, spread="sphere"),
        loss=LossConfig(beta=0.25, projection=PixelBins(1 / 30)),
        views=ViewConfig(tracks=8, views=4, points=3096, window=20, sensor="camera"),
        optim=OptimConfig(steps=300_000, lr=1e-4, decay=0.5, decay_every=100_000),
    )


def small() -> Recipe:
    """Learns on two CPU cores in minutes: half the widths and points, and what we add.

    Beyond the paper: scans turned towards their object, mirror symmetry, bins that face
    the object, a higher learning rate that falls along a cosine, averaged weights.
    """
    return Recipe(
        name="small",
        network=NetworkConfig(
            encoder=(64, 128, 256, 512),
            decoder=(512, 512),
            pose=(256, 128),
            points=1024,
            branches=4,
            selector=True,
            mirror=True,
            start=(1.0, 0.45, 0.35),
            scale=2.0,
        ),
        loss=LossConfig(
            beta=0.25,
            projection=FacingBins(0.4),
            belief=0.05,
            time_ordered=True,
            agree_at=(0.15, 0.4),
        ),
        views=ViewConfig(points=512, window=40, turn="facing"),
        optim=OptimConfig(
            steps=12_000, lr=1e-3, decay_every=0, warmup=100, average=0.998, clip=5.0
        ),
        validate_every=500,
    )


def views() -> Recipe:
    """Depth views of objects of unit size (box diagonal 1): `small` with a fifth of its lengths.

    Views come in no order, so that an object may well turn around from one to the next; headings
    are agreed on by what the views say of each other.
    """
    base = small()
    return replace(
        base,
        name="views",
        network=replace(base.network, scale=0.4),
        loss=replace(
            base.loss,
            projection=FacingBins(0.06),
            belief=0.01,
            time_ordered=False,
            agree_at=(0.2, 0.5),
        ),
        views=replace(base.views, sensor="camera"),
        optim=replace(base.optim, steps=8_000, search="bf16"),
    )


def default() -> Recipe:
    """For a long run: `small` with more shape points and finer bins.

    Its widths are those of `small` and of the shipped weights: it can be trained without a GPU.
    """
    base = small()
    return replace(
        base,
        name="default",
        network=replace(base.network, points=4096),
        loss=replace(base.loss, projection=FacingBins(0.3), agree_at=(0.07, 0.3)),
        views=replace(base.views, roll=0.4),
        optim=replace(base.optim, steps=30_000, average=0.999, search="bf16"),
        validate_every=1000,
    )


def tiny() -> Recipe:
    """For tests: `small` with half its widths and points; learns little, in seconds."""
    base = small()
    network = replace(
        base.network, encoder=(32, 64, 128, 256), decoder=(256, 256), pose=(128, 64), points=512
    )
    optim = replace(base.optim, steps=500, lr=2e-3, warmup=20, average=0.99)
    return replace(
        base,
        name="tiny",
        network=network,
        views=replace(base.views, points=256),
        optim=optim,
        validate_every=100,
    )


def with_rays(recipe: Recipe, rays: RayConfig | None) -> Recipe:
    """The recipe with a network that sees rays, as that of the weights it goes on from."""
    return replace(recipe, network=replace(recipe.network, rays=rays))


def with_encoder(recipe: Recipe, backbone: Backbone) -> Recipe:
    """The recipe with that point network as the encoder, of the same widths."""
    return replace(recipe, network=replace(recipe.network, backbone=backbone))


def shape_oracle(recipe: Recipe) -> Recipe:
    """The recipe for the paper's oracle (section 5.7), whose teacher is the truth: shapes alone.

    Encoder and shape decoder learn the canonical shape; no pose is learned, and scans are taught
    as they were recorded.
    """
    plain = OcclusionConfig(strip=0.0, side=0.0, top=0.0, feet=0.0, rings=0.0)
    draw = DrawConfig(larger=0.0, axis=0.0, reflected=0.0, both_ends=1.0, near=1.0, occlusion=plain)
    loss = TaughtLossConfig(pose=0.0, belief=0.0)
    return replace(recipe, self_training=replace(recipe.self_training, draw=draw, loss=loss))


PRESETS = {
    "paper-lidar": paper_lidar,
    "paper-views": paper_views,
    "default": default,
    "small": small,
    "views": views,
    "tiny": tiny,
}


def recipe_named(preset: str) -> Recipe:
    """The preset as it is.

    Raises:
        BadInputError: there is none of that name.
    """
    if preset not in PRESETS:
        raise BadInputError(f"--preset {preset}: is unknown; use one of {', '.join(PRESETS)}.")
    return PRESETS[preset]()


def sensor_kind(store: Store) -> SensorKind:
    """The kind of sensor that took all tracks; costs milliseconds however many there are.

    Raises:
        BadInputError: there are two kinds.
    """
    _, firsts = np.unique(store.column("sensors"), return_index=True)
    kinds: set[SensorKind] = {store.sensor_of(int(track)).kind for track in firsts}
    if len(kinds) > 1:
        raise BadInputError(
            f"{store.named}: holds lidar and camera scans, but a network is trained on one kind;"
            " split it into a store of each."
        )
    return kinds.pop()


def only_sensor(recipe: Recipe) -> SensorKind | None:
    """The sensor that a preset of the paper was made for; others take either."""
    return recipe.views.sensor if recipe.name.startswith("paper-") else None


def refuse_other_sensor(
    named: Path, found: SensorKind, only: SensorKind | None, preset: str
) -> None:
    """Refuse scans of another sensor than the only one that a preset is for.

    Raises:
        BadInputError: they are.
    """
    if only in (None, found):
        return
    others = {"lidar": "dpc-lidar", "camera": "dpc or dpc-dagger"}
    other = others[found] if preset.startswith("dpc") else "another preset"
    raise BadInputError(
        f"{named}: holds {found} scans, but preset {preset} is for {only} scans; choose {other}."
    )


def recipe_for(store: Store, preset: str, steps: int | None) -> Recipe:
    """The preset, for the kind of sensor in the store, stretched to other steps if asked.

    Raises:
        BadInputError: an unknown preset, two kinds of sensor, or a preset of the paper that was
            made for the other.
    """
    recipe = recipe_named(preset)
    kind = sensor_kind(store)
    refuse_other_sensor(store.named, kind, only_sensor(recipe), preset)
    if kind != recipe.views.sensor:
        recipe = replace(recipe, views=replace(recipe.views, sensor=kind))
    if steps is None:
        return recipe
    return replace(recipe, optim=stretched(recipe.optim, steps))
