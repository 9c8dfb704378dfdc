# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the rays beside an object add to the code of its scan (beyond the paper).

A scan alone does not say why it ends where it does: something may hide the rest, or there may be
no more. The rays of the frame know.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn.functional import relu

from wildshape.geometry.projection.ray_points import KINDS, ray_points
from wildshape.geometry.projection.sight_lines import seen_alike
from wildshape.method.encoders.pcn_winners import at_rows
from wildshape.ops.column_argmax import column_argmax
from wildshape.ops.threads import spread

_NEVER = -1e9


@dataclass(frozen=True)
class RayConfig:
    """How a network sees the rays beside its object.

    Attributes:
        count: points of rays that it sees at most (`ray_points.py`).
        widths: of the layers that each of them goes through.
        depth_m: half of what an object may be deep.
        within_m: points of rays farther from the scan's centre are not seen.
    """

    count: int = 192
    widths: tuple[int, int, int] = (64, 128, 256)
    depth_m: float = 2.5
    within_m: float = 5.0

    def seen(
        self, ends: Float[Tensor, "m 3"], starts: Float[Tensor, "m 3"], centre: Float[Tensor, "3"]
    ) -> Float[Tensor, "R 6"]:
        """The rays beside an object as the network sees them (`ray_points`).

        Merged sensors see from several sides; those of the sensor's own side are seen alone.
        """
        alike = seen_alike(starts.numpy(), np.zeros(3, np.float32), centre.numpy())
        ends, starts = ends[alike], starts[alike]
        limits = {"depth_m": self.depth_m, "within_m": self.within_m}
        return ray_points(ends, centre, self.count, starts=starts, **limits)


class RayEncoder(nn.Module):
    """Points of rays to a change of the code: a small PointNet; none at the start of training."""

    def __init__(self, widths: tuple[int, int, int], code: int) -> None:
        super().__init__()
        self.layer1 = nn.Linear(3 + KINDS, widths[0])
        self.layer2 = nn.Linear(widths[0], widths[1])
        self.layer3 = nn.Linear(widths[1], widths[2])
        self.change = nn.Linear(widths[2], code)
        nn.init.zeros_(self.change.weight)
        nn.init.zeros_(self.change.bias)

    def forward(self, rays: Float[Tensor, "B R 6"]) -> Float[Tensor, "B z"]:
        """What to add to codes; nothing to those of scans without rays.

        Args:
            rays: see `ray_points`; positions in units of the network's scale.
        """
        known = rays[..., 3:].any(-1)
        most = self._each(rays).masked_fill(~known[..., None], _NEVER).amax(1)
        return self._changed(most, known)

    def by_winners(self, rays: Float[Tensor, "B R 6"]) -> Float[Tensor, "B z"]:
        """The same, trained on a CPU through the rays that the maximum takes (`pcn_winners.py`)."""
        known = rays[..., 3:].any(-1)
        first = torch.arange(len(rays), device=rays.device)[:, None] * rays.shape[1]
        rows = self._winning_rows(rays, known) + first
        active, at = torch.unique(rows, return_inverse=True)
        inner = relu(self.layer2(relu(self.layer1(rays.flatten(0, 1)[active]))))
        return self._changed(at_rows(self.layer3, inner, at), known)

    @torch.no_grad()
    def _winning_rows(
        self, rays: Float[Tensor, "B R 6"], known: Bool[Tensor, "B R"]
    ) -> Int[Tensor, "B c"]:
        """The known ray of each feature's maximum, scan by scan; the first where none is known."""
        none = torch.zeros(self.layer3.out_features, dtype=torch.int64)

        @torch.no_grad()  # each thread has a setting of its own
        def of_one(one: tuple[Tensor, Tensor]) -> Tensor:
            points, seen = one
            if not seen.any():
                return none
            return column_argmax(self._each(points).masked_fill_(~seen[:, None], _NEVER))

        return torch.stack(spread(of_one, zip(rays, known)))

    def _each(self, rays: Float[Tensor, "*R 6"]) -> Float[Tensor, "*R c"]:
        """Features of each ray, before the last ReLU: the maximum may be taken first."""
        return self.layer3(relu(self.layer2(relu(self.layer1(rays)))))

    def _changed(
        self, most: Float[Tensor, "B c"], known: Bool[Tensor, "B R"]
    ) -> Float[Tensor, "B z"]:
        """What the greatest features add; nothing where no ray is known."""
        some = known.any(1, keepdim=True)
        return self.change(torch.where(some, relu(most), 0.0)) * some
