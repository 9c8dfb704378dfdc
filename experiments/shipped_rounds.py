# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rounds that the vehicles' weights are trained in, and what each learns from."""

from dataclasses import dataclass, replace
from typing import Literal

from wildshape.method.ray_encoder import RayConfig
from wildshape.training.config import Recipe
from wildshape.training.recipes import PRESETS

_VALIDATE_EVERY = 10_000


@dataclass(frozen=True)
class Round:
    """One training of the vehicles' weights.

    Attributes:
        data: seed of its tracks.
        steps: gradient steps.
        preset: whose recipe it is; `small` has a quarter of the shape's points and teaches as well.
        lr: learning rate that it falls from; None: the preset's.
        teacher: round that poses and fuses its tracks; None: the paper's objective.
        start: round whose weights it goes on from; None: random ones.
        rays: the network sees those of the frames, too.
        driving: its vehicles drive, and it is taught that they look where they go.
    """

    data: int
    steps: int
    preset: Literal["small", "default"] = "default"
    lr: float | None = None
    teacher: str | None = None
    start: str | None = None
    rays: bool = False
    driving: bool = False

    def recipe(self, steps: int) -> Recipe:
        """What so many steps of it are."""
        base = PRESETS[self.preset]()
        rate = base.optim.lr if self.lr is None else self.lr
        return replace(
            base,
            network=replace(base.network, rays=RayConfig() if self.rays else None),
            optim=replace(base.optim, steps=steps, lr=rate, precision="fp32"),
            validate_every=_VALIDATE_EVERY,
        )


ROUNDS = {
    "first": Round(data=1, steps=6_000, preset="small"),
    "taught": Round(data=1, steps=8_000, teacher="first"),
    "second": Round(data=2, steps=12_000, teacher="taught", start="taught"),
    "main": Round(data=3, steps=30_000, teacher="second", start="second"),
    "rays": Round(data=4, steps=100_000, lr=8e-4, teacher="main", start="main", rays=True),
    "driven": Round(
        data=5, steps=20_000, lr=4e-4, teacher="rays", start="rays", rays=True, driving=True
    ),
}
"""In their order; the last one is shipped."""


@dataclass(frozen=True)
class Tracks:
    """The simulated drives of a data set.

    Attributes:
        count: of all sensors and sources; as many of each.
        occlusion: share of them past something that stands in the way.
        rays: kept with a scan.
        varied: forms and sensors varied, or as they are, as many tracks of each.
    """

    count: int = 2400
    occlusion: float = 0.3
    rays: int = 0
    varied: tuple[bool, ...] = (True, False, False, False)


_WITH_RAYS = Tracks(occlusion=0.5, rays=512)
DATA = {
    1: Tracks(),
    2: Tracks(),
    3: Tracks(count=4800),
    4: replace(_WITH_RAYS, count=4800),
    5: _WITH_RAYS,
}
"""By their seeds. What is learned carries over to unseen objects the better the more there were."""
