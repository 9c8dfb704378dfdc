# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How large a table is made: minutes on a CPU, hours, or as the paper has it."""

from dataclasses import dataclass, replace
from typing import Literal

from wildshape.baselines.dpc.objective import DpcRecipe
from wildshape.baselines.dpc.objective import small as small_dpc
from wildshape.errors import BadInputError
from wildshape.training.config import OptimConfig, Recipe, stretched
from wildshape.training.recipes import small, tiny

Like = Literal["tiny", "small"]
_LIDAR_UNIT_M, _FEW = 2.0, 1000
_TINY = (
    " The machinery works, a method is not judged by it: so early rows may stand in any order, and"
    " a difference below the spread over seeds is chance."
)


@dataclass(frozen=True)
class Size:
    """One of `SIZES`.

    Attributes:
        name: as on the command line.
        train: tracks.
        test: tracks measured; at most 141, the CAD cars of the test split.
        steps: of each training; None: the preset's own number, network and schedule.
        seeds: trainings of each method; some tables take fewer (`ablation_seeds`, `side_seeds`).
        max_scans: of a tested track, evenly; None: all.
        like: the preset whose widths, points and schedule are used where `steps` is given.
        own_schedule: recipes of the paper keep the shape of their schedule instead, shortened
            evenly: steps down, neither warm-up nor averaged weights; `like` gives the first rate.
    """

    name: str
    train: int
    test: int
    steps: int | None
    seeds: int
    max_scans: int | None
    like: Like = "tiny"
    own_schedule: bool = False

    @property
    def ablation_seeds(self) -> int:
        """Ablations have many rows: one seed each but for the largest size."""
        return self.seeds if self.seeds >= 5 else 1

    @property
    def side_seeds(self) -> int:
        """Of tables with many trainings: enough for a spread where a method could be judged."""
        return 1 if self.steps is not None and self.steps < _FEW else min(self.seeds, 3)

    @property
    def said(self) -> str:
        """For the foot of a table: what the figures can be worth."""
        drives = f"Size {self.name}: at most {self.train} tracks to train and {self.test} to test,"
        if self.steps is None:
            return f"{drives} the presets as they are."
        return f"{drives} {self.steps} steps.{_TINY if self.steps < _FEW else ''}{self._thinned}"

    @property
    def _thinned(self) -> str:
        """What thinning does to some rows and not to others."""
        if self.max_scans is None:
            return ""
        return (
            f" At most {self.max_scans} scans of each tested track, spread over it: neighbours lie"
            " farther apart than recorded, which costs what is chained (ICP) and not what is"
            " learned."
        )


SIZES = {
    "test": Size("test", 6, 3, 10, 2, 4),
    "tiny": Size("tiny", 40, 12, 400, 3, 6),
    "hour": Size("hour", 200, 30, 1000, 3, 8),
    "small": Size("small", 300, 60, 6000, 3, 12, "small", own_schedule=True),
    "full": Size("full", 4000, 141, None, 5, None),
}


def changed(size: Size, share: float = 1.0, steps: int | None = None) -> Size:
    """A size with a share of the tracks and steps, or other steps, under a name of its own.

    Raises:
        BadInputError: no steps, or no tracks.
    """
    if share <= 0:
        raise BadInputError(f"--share {share:g}: expected more than 0.")
    if steps is not None and steps < 1:
        raise BadInputError(f"--steps {steps}: expected 1 or more.")
    if steps is not None:
        size = replace(size, name=f"{size.name}-{steps}-steps", steps=steps)
    if share == 1:
        return size
    assert size.steps is not None
    counts = {
        name: max(4, round(share * getattr(size, name))) for name in ("train", "test", "steps")
    }
    return replace(size, name=f"{size.name}-{share:g}", **counts)


def sized(recipe: Recipe, size: Size) -> Recipe:
    """The recipe at a size: what it minimises is kept, how large and how long is not.

    The paper's learning rate learns nothing in a few hundred steps, and its network unit of one
    metre makes a car's shape grow slowly; both are those of our small presets.
    """
    if size.steps is None:
        return recipe
    base = small() if size.like == "small" else tiny()
    unit = _LIDAR_UNIT_M if recipe.views.sensor == "lidar" else recipe.network.scale
    network = replace(
        recipe.network,
        encoder=base.network.encoder,
        decoder=base.network.decoder,
        pose=base.network.pose,
        points=base.network.points,
        scale=unit,
    )
    return replace(
        recipe,
        network=network,
        views=replace(recipe.views, points=base.views.points),
        optim=schedule(recipe, base, size),
        validate_every=min(1000, size.steps),
    )


def schedule(recipe: Recipe, base: Recipe, size: Size) -> OptimConfig:
    """That of our preset, or the paper's own at as many steps."""
    assert size.steps is not None
    own = recipe.optim
    if not (size.own_schedule and own.decay_every):
        return replace(base.optim, steps=size.steps)
    return replace(stretched(own, size.steps), lr=base.optim.lr)


def sized_dpc(recipe: DpcRecipe, size: Size) -> DpcRecipe:
    """DPC at a size: as its authors have it, or at its small resolution."""
    if size.steps is None:
        return recipe
    base = small_dpc(recipe)
    return replace(base, optim=replace(base.optim, steps=size.steps))
