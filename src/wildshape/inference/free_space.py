# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the rays of a frame say of a completed shape, where a scan has any (METHOD 13).

Nothing of an object can stand where a ray passed. What is hidden behind something else is no
evidence for or against a shape.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.projection.sight_lines import SightLines, Standing, standing
from wildshape.geometry.projection.visibility import Projection
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import FreeSpaceConfig
from wildshape.method.hindsight import Scores, score_hypotheses
from wildshape.method.observation import projection_term
from wildshape.records import Points

Rays = Sequence[SightLines | None]
"""One set a scan, None for a scan without; nothing at all where no scan has any."""
_LENGTHS = ("within_m", "beyond_m", "free_m", "low_m")


class Sights(NamedTuple):
    """Scans as the sensor saw them, with the rays that passed their objects by.

    Attributes:
        scans: sensor frames, metres.
        rays: one set a scan.
    """

    scans: Sequence[Points]
    rays: Rays
    config: FreeSpaceConfig

    @classmethod
    def of_objects(
        cls, scans: Sequence[Points], rays: Rays, config: FreeSpaceConfig, unit: float
    ) -> "Sights":
        """With the lengths of `config`, which are of vehicles, in metres of `unit` (`unit_of`)."""
        lengths = {name: unit * getattr(config, name) for name in _LENGTHS}
        return cls(scans, rays, replace(config, **lengths))

    def part(self, rows: Sequence[int]) -> "Sights":
        """Some of the scans."""
        scans, rays = [self.scans[i] for i in rows], [self.rays[i] for i in rows]
        return Sights(scans, rays, self.config)

    def of(self, points: Points, i: int) -> Standing | None:
        """What the rays of scan `i` say of points in its sensor frame."""
        rays, config = self.rays[i], self.config
        if rays is None or not config.nearest or not np.isfinite(rays.ranges).any():
            return None
        return standing(
            points,
            self.scans[i],
            rays,
            beyond_m=config.beyond_m,
            within_m=config.within_m,
            nearest=config.nearest,
        )


class SeenScores:
    """Scores hypotheses as `score_hypotheses`, and by the rays of their frames.

    The projection term leaves out what is hidden; shape in free space costs.
    """

    def __init__(self, sights: Sights, turn: Float[Tensor, "B 3 3"]) -> None:
        """`turn`: `R_turned_sensor` of the frames that the scans are scored in."""
        self.sights, self.turn = sights, turn

    def __call__(
        self,
        scans: Float[Tensor, "B N 3"],
        centres: Float[Tensor, "B 3"],
        posed: Float[Tensor, "B H P 3"],
        projection: Projection,
    ) -> Scores:
        """See `score_hypotheses`."""
        scores = score_hypotheses(scans, centres, posed, projection)
        in_sensor = (posed + centres[:, None, None]) @ self.turn[:, None]
        terms, costs = scores.projection.clone(), torch.zeros_like(scores.projection)
        for i in range(len(scans)):
            found = self.sights.of(in_sensor[i].flatten(0, 1).cpu().numpy(), i)
            if found is None:
                continue
            free, hidden = (torch.from_numpy(part).view(posed.shape[1:3]) for part in found)
            seen = scores.visible[i] & ~hidden.to(posed.device)
            terms[i] = projection_term(
                posed[i], scans[i].expand(len(posed[i]), -1, -1), scores.to_scan[i], seen
            )
            costs[i] = self.sights.config.free_m * free.float().mean(-1).to(posed.device)
        return scores._replace(projection=terms, free_space=costs)


def without_free_space(
    shape: Float[Tensor, "P 3"], T_sensor_canonical: SE3, sights: Sights
) -> Float[Tensor, "p 3"]:
    """A shape's points without those that stand where rays of any of its scans passed.

    What is low is left: below a body rays pass to the ground, and wheels are narrow. So is a shape
    most of which would go: then the pose is wrong.

    Args:
        shape: canonical frame.
        T_sensor_canonical: one pose a scan.
        sights: scans and rays.
    """
    low = shape[:, 2] - shape[:, 2].min() < sights.config.low_m
    free, asked = np.zeros(len(shape), bool), ~low.numpy()
    high = shape.numpy()[asked]
    for i in range(len(sights.scans)):
        if sights.rays[i] is not None:
            found = sights.of(T_sensor_canonical[i].to(torch.float64).apply_numpy(high), i)
            free[asked] |= False if found is None else found.free
    kept = torch.from_numpy(~free)
    return shape[kept] if kept.float().mean() > sights.config.least_kept else shape
