# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A network's look at scans: what it is given, which pose hypothesis speaks, and a second look.

The second look goes beyond the paper. Turned towards its object (`line_of_sight.py`), nothing of a
scan's rotation is unknown but the roll about the line of sight, and upright is what a network knows
best. A scan that turns out to be tilted is rolled upright, as the first look says, and seen once
more; the cheaper answer speaks.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Generic, NamedTuple, Protocol, TypeVar, runtime_checkable

import torch
from jaxtyping import Float, Int, Int64
from torch import Tensor

from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import face_each, roll, roll_angle
from wildshape.geometry.projection.ray_points import KINDS
from wildshape.geometry.projection.sight_lines import SightLines
from wildshape.geometry.projection.visibility import Projection
from wildshape.geometry.sampling import drawn, sorted_points
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.confidence import look_features
from wildshape.inference.config import HypothesisRule
from wildshape.inference.free_space import Rays, SeenScores, Sights
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import Poses, ShapePoseNet
from wildshape.method.ray_encoder import RayConfig
from wildshape.method.trust import Surface
from wildshape.method.trust_features import rival_margin
from wildshape.records import Points, SensorKind

_RULE = HypothesisRule()


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

    def beside(self, sights: Sights | None, config: RayConfig | None) -> "NetworkInput":
        """The same with the rays of the scans' frames, if there are any and a network sees them."""
        if sights is None or config is None:
            return self
        seen = [
            _rays_seen(one, turn, centre, config)
            for one, turn, centre in zip(sights.rays, self.turn, self.centres, strict=True)
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


class Found(NamedTuple):
    """What looks at scans give: shapes, `T_sensor_canonical`, cost, branch, and features.

    The features are those of `look_features`, and last the margin of the best rival.
    """

    shapes: Float[Tensor, "B P 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    cost: Float[Tensor, "B"]
    branch: Int[Tensor, "B"]
    features: Float[Tensor, "B F"]

    def part(self, rows: Int[Tensor, "b"]) -> "Found":
        """Some of the scans."""
        return Found(*(part[rows] for part in self))

    def replaced(self, rows: Int[Tensor, "b"], new: "Found") -> "Found":
        """With other answers for some of the scans."""
        return Found(*(old.index_copy(0, rows, part) for old, part in zip(self, new)))

    def said(self, i: int) -> tuple[SE3, float, int, Tensor]:
        """Of scan `i` its pose, the cost, the branch and what `look_features` tells."""
        pose = SE3(self.rotation[i].double(), self.translation[i].double())
        return pose, float(self.cost[i]), int(self.branch[i]), self.features[i, :-1]


class Looked(NamedTuple):
    """Scans, and what a network says of them.

    Attributes:
        scans: sensor frames, metres.
        seen: the same without ground beside the object.
        found: one row a scan.
        sights: with the rays of their frames, where any are known.
    """

    scans: Sequence[Points]
    seen: Sequence[Points]
    found: Found
    sights: Sights | None = None

    @classmethod
    def joined(cls, parts: Sequence["Looked"]) -> "Looked":
        """All scans, with the rays of those that have any."""
        found = Found(*(torch.cat(rows) for rows in zip(*[part.found for part in parts])))
        scans = [one for part in parts for one in part.scans]
        seen = [one for part in parts for one in part.seen]
        known = [part.sights for part in parts if part.sights is not None]
        if not known:
            return cls(scans, seen, found)
        rays = [one for part in parts for one in part.rays]
        return cls(scans, seen, found, known[0]._replace(scans=scans, rays=rays))

    @property
    def rays(self) -> Rays:
        """One set a scan, None for a scan without."""
        return [None] * len(self.scans) if self.sights is None else self.sights.rays

    def each(self) -> list["Looked"]:
        """Each scan by itself."""
        rows = torch.arange(len(self.scans))[:, None]
        parts = [self.sights and self.sights.part([i]) for i in range(len(self.scans))]
        every = zip(self.scans, self.seen, rows, parts)
        return [Looked([scan], [seen], self.found.part(row), own) for scan, seen, row, own in every]


class Posed(NamedTuple):
    """What is made of a batch of scans.

    Attributes:
        shapes: the network's points, canonical frame.
        T_sensor_canonical: their poses.
        points: of the complete shapes, sensor frames, those of `shapes` first.
        surfaces: of the scans, for weights that tell how far they are to be trusted.
    """

    shapes: Float[Tensor, "B P 3"]
    T_sensor_canonical: SE3
    points: Float[Tensor, "B Q 3"]
    surfaces: Sequence[Surface] = ()

    @classmethod
    def of(cls, found: Found) -> "Posed":
        """As the network says."""
        T_sensor_canonical = SE3(found.rotation, found.translation)
        return cls(found.shapes, T_sensor_canonical, T_sensor_canonical.apply(found.shapes))


def look(
    network: ShapePoseNet,
    settings: ModelSettings,
    inputs: NetworkInput,
    sights: Sights | None = None,
) -> Found:
    """Shapes, and the poses of the hypotheses that speak, from prepared scans."""
    own = partial(score_hypotheses, sizes=inputs.sizes)
    score = own if sights is None else SeenScores(sights, inputs.turn)
    found = choose_hypothesis(
        network, inputs.scans, inputs.centres, settings, score, inputs.sizes, inputs.rays
    )
    seen = look_features(inputs.scans, found.posed, found.scores, found.poses, found.believed)
    features = torch.cat((seen, rival_margin(found.poses, found.believed)), -1)
    return in_sensor_frame(found, inputs, settings, features)


def in_sensor_frame(
    found: Chosen[ScoresT],
    inputs: NetworkInput,
    settings: ModelSettings,
    features: Float[Tensor, "B F"],
) -> Found:
    """The hypotheses that speak, in the frames of the sensors."""
    back, chosen = inputs.turn.mT, found.pose
    translation = back @ (chosen.translation[:, 0] + inputs.centres)[..., None]
    rotation, cost = back @ chosen.rotation[:, 0], found.cost(settings.beta)
    return Found(found.shapes, rotation, translation[..., 0], cost, found.branch, features)


def look_twice(
    network: ShapePoseNet,
    settings: ModelSettings,
    inputs: NetworkInput,
    rule: HypothesisRule = _RULE,
    sights: Sights | None = None,
) -> Found:
    """`look`, and a second one at the scans that turn out to be tilted, rolled upright."""
    first = look(network, settings, inputs, sights)
    angle = roll_angle(inputs.turn @ first.rotation)
    rows = torch.nonzero(angle.abs() > rule.upright_rad)[:, 0]
    if len(rows) == 0:
        return first
    again = None if sights is None else sights.part(rows.tolist())
    second = look(network, settings, inputs.part(rows).rolled(angle[rows]), again)
    cheaper = torch.nonzero(second.cost < first.cost[rows])[:, 0]
    return first.replaced(rows[cheaper], second.part(cheaper))
