# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a network is given of scans, and which of its pose hypotheses speaks (METHOD 3, 6)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import torch
from jaxtyping import Float, Int, Int64
from torch import Tensor

from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import face_each, roll
from wildshape.geometry.projection.ray_points import KINDS
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.projection.visibility import Projection
from wildshape.geometry.sampling import drawn, sorted_points
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import Poses, ShapePoseNet
from wildshape.method.ray_encoder import RayConfig
from wildshape.records import Points, SensorKind


class NetworkInput(NamedTuple):
    """What a network sees of scans.

    Attributes:
        scans: turned, centred and resampled.
        centres: in the turned sensor frames.
        turn: `R_turned_sensor`; the identity unless scans are turned towards their object.
        sizes: points of each scan that come first; all others repeat one of them.
        rays: beside each object (`ray_points`), turned and centred likewise; R = 0 where none are
            known, or where the network sees none.
    """

    scans: Float[Tensor, "B N 3"]
    centres: Float[Tensor, "B 3"]
    turn: Float[Tensor, "B 3 3"]
    sizes: Int64[Tensor, "B"]
    rays: Float[Tensor, "B R 6"]

    def to(self, device: torch.device) -> "NetworkInput":
        """The same on a device."""
        return NetworkInput(*(part.to(device) for part in self))

    def part(self, rows: Int64[Tensor, "b"]) -> "NetworkInput":
        """Some of the scans."""
        return NetworkInput(*(part[rows] for part in self))

    def rolled(self, angle: Float[Tensor, "B"]) -> "NetworkInput":
        """Rolled about the line of sight, on which the centres lie."""
        by = roll(angle)
        rays = torch.cat((self.rays[..., :3] @ by.mT, self.rays[..., 3:]), dim=-1)
        return NetworkInput(self.scans @ by.mT, self.centres, by @ self.turn, self.sizes, rays)

    def beside(
        self, rays: Sequence[SightLines | None] | None, config: RayConfig | None
    ) -> "NetworkInput":
        """The same with the rays of the scans' frames, if there are any and a network sees them."""
        if rays is None or config is None:
            return self
        seen = [
            _rays_seen(one, turn, centre, config)
            for one, turn, centre in zip(rays, self.turn, self.centres, strict=True)
        ]
        return self._replace(rays=torch.stack(seen))


def network_input(
    scans: Sequence[Points], count: int, sensor: SensorKind, facing: bool = False
) -> NetworkInput:
    """Scans as a network is given them; `facing` turns them towards their object."""
    ordered = [torch.from_numpy(sorted_points(scan)) for scan in scans]
    sampled = torch.stack([scan[torch.from_numpy(drawn(len(scan), count))] for scan in ordered])
    sizes = torch.tensor([min(len(scan), count) for scan in ordered])
    unseen = sampled.new_zeros(len(scans), 0, 3 + KINDS)
    if facing:
        turn, centres = face_each(ordered, sensor)
        return NetworkInput(sampled @ turn.mT - centres[:, None], centres, turn, sizes, unseen)
    centres = torch.stack([scan_centre(scan, sensor) for scan in ordered])
    turn = torch.eye(3, dtype=sampled.dtype).repeat(len(scans), 1, 1)
    return NetworkInput(sampled - centres[:, None], centres, turn, sizes, unseen)


def _rays_seen(
    rays: SightLines | None,
    turn: Float[Tensor, "3 3"],
    centre: Float[Tensor, "3"],
    config: RayConfig,
) -> Float[Tensor, "R 6"]:
    if rays is None:
        return centre.new_zeros(config.count, 3 + KINDS)
    found = rays.returned
    ends, starts = (torch.from_numpy(part) @ turn.T for part in (found.ends, found.starts))
    return config.seen(ends, starts, centre)


@runtime_checkable
class CostRule(Protocol):
    """What a hypothesis costs: a checkpoint's settings, or the configuration of the loss."""

    @property
    def projection(self) -> Projection:
        """How the sensor's image is binned."""
        ...

    @property
    def beta(self) -> float:
        """Weight of the projection term."""
        ...

    @property
    def belief(self) -> float:
        """Metres of cost that a nat of the selector's belief is worth."""
        ...


@runtime_checkable
class HypothesisScores(Protocol):
    """What a hypothesis scored: of `method/hindsight.py`, or of an exported graph."""

    def cost(self, beta: float) -> Float[Tensor, "B K"]:
        """The label-free cost of each hypothesis, metres."""
        ...


ScoresT = TypeVar("ScoresT", bound=HypothesisScores)
Score = Callable[[Tensor, Tensor, Tensor, Projection], ScoresT]
"""Scans, centres, posed shapes and the projection -> scores, as `score_hypotheses`."""


@dataclass(frozen=True)
class Chosen(Generic[ScoresT]):
    """The hypotheses of centred scans, and the one that speaks for each.

    Attributes:
        shapes: canonical, metres.
        poses: all hypotheses, centred frames.
        posed: the shapes under every hypothesis.
        scores: of the hypotheses.
        believed: what decides, metres: the label-free cost (METHOD 3, 6) less the belief.
        branch: the hypothesis with the least of it.
    """

    shapes: Float[Tensor, "B P 3"]
    poses: Poses
    posed: Float[Tensor, "B K P 3"]
    scores: ScoresT
    believed: Float[Tensor, "B K"]
    branch: Int[Tensor, "B"]

    @property
    def pose(self) -> Poses:
        """The hypothesis that speaks, K = 1."""
        return self.poses.choose(self.branch)

    def cost(self, beta: float) -> Float[Tensor, "B"]:
        """Its label-free cost, metres."""
        return self.scores.cost(beta).gather(1, self.branch[:, None])[:, 0]


def choose_hypothesis(
    network: ShapePoseNet,
    scans: Float[Tensor, "B N 3"],
    centres: Float[Tensor, "B 3"],
    rule: CostRule,
    score: Score[ScoresT] = score_hypotheses,
    sizes: Int64[Tensor, "B"] | None = None,
    rays: Float[Tensor, "B R 6"] | None = None,
) -> Chosen[ScoresT]:
    """Ask a network, score its hypotheses against the scans, and take the cheapest.

    Args:
        network: in evaluation.
        scans: centred, as it was trained on.
        centres: where each scan's centre lies in the frame it was turned into.
        rule: what a hypothesis costs.
        score: gives both terms of the cost.
        sizes: points of each scan that come first, if all others repeat one of them.
        rays: beside each object, if known.
    """
    shapes, *hypotheses = network(scans, sizes, rays)
    poses = Poses(*hypotheses)
    posed = poses.apply(shapes)
    scores = score(scans, centres, posed, rule.projection)
    believed = scores.cost(rule.beta) - rule.belief * poses.log_belief
    return Chosen(shapes, poses, posed, scores, believed, believed.argmin(-1))
