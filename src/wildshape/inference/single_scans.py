# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Single scans: what a network says of them, and how each is completed on its own (METHOD 7).

Two things go beyond the paper. Turned towards its object (`line_of_sight.py`), nothing of a scan's
rotation is unknown but the roll about the line of sight, and upright is what a network knows best:
a scan that turns out to be tilted is rolled upright, as the first look says, and seen once more;
the cheaper answer speaks. And a scan with much ground beside its object is seen again without it.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from wildshape.geometry.densify import denser, partners
from wildshape.geometry.ground import without_skirt
from wildshape.geometry.projection.line_of_sight import roll_angle
from wildshape.geometry.sampling import sorted_points
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.inference.boxes import box_seen
from wildshape.inference.confidence import (
    glance_of,
    judged,
    look_features,
    reasons_of_object,
)
from wildshape.inference.config import HypothesisRule, InferenceConfig, RefineConfig
from wildshape.inference.free_space import Rays, SeenScores, Sights, without_free_space
from wildshape.inference.refine import Refined, refine, with_its_scan
from wildshape.io.scans.points import LEAST_POINTS
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.choose_hypothesis import (
    Chosen,
    NetworkInput,
    ScoresT,
    choose_hypothesis,
    network_input,
)
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.network import ShapePoseNet
from wildshape.method.trust import Surface
from wildshape.method.trust_features import rival_margin, scan_features, surfaces
from wildshape.records import Completion, Points, Sensor

_RULE = HypothesisRule()


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


def looked_at(
    scans: Sequence[Points],
    rays: Rays,
    network: ShapePoseNet,
    settings: ModelSettings,
    config: InferenceConfig,
    *,
    off_ground: bool,
) -> Looked:
    """Scans in one batch; `off_ground`: without the ground beside their objects."""
    known = any(one is not None for one in rays)
    free_space, unit = config.free_space, settings.unit
    sights = Sights.of_objects(scans, rays, free_space, unit) if known else None
    found = _found(scans, sights, network, settings, config.hypothesis)
    if not off_ground:
        return Looked(scans, scans, found, sights)
    seen = _each_off_ground(scans, found)
    least = 1 - config.ground_share
    much = [i for i, kept in enumerate(seen) if len(kept) < least * len(scans[i])]
    if much:  # the network has seen the ground, too: once more without it
        part = sights and sights.part(much)
        again = _found([seen[i] for i in much], part, network, settings, config.hypothesis)
        found = found.replaced(torch.tensor(much), again)
        for i, kept in zip(much, _each_off_ground([scans[i] for i in much], again)):
            seen[i] = kept
    return Looked(scans, seen, found, sights)


def _found(
    scans: Sequence[Points],
    sights: Sights | None,
    network: ShapePoseNet,
    settings: ModelSettings,
    rule: HypothesisRule,
) -> Found:
    """What a network says of scans, on the host."""
    inputs = network_input(scans, settings.input_points, settings.sensor, settings.facing)
    inputs = inputs.beside(sights and sights.rays, settings.network.rays).to(
        next(network.parameters()).device
    )
    if settings.facing:
        found = look_twice(network, settings, inputs, rule, sights)
    else:
        found = look(network, settings, inputs, sights)
    return Found(*(part.cpu() for part in found))


def _each_off_ground(scans: Sequence[Points], found: Found) -> list[Points]:
    """Each scan without the ground beside the object found in it."""
    return [
        off_ground(scan, shape.numpy(), SE3(rotation, translation))
        for scan, shape, rotation, translation in zip(scans, *found[:3])
    ]


def off_ground(scan: Points, shape: Points, T_sensor_canonical: SE3) -> Points:
    """The scan without the ground beside its object."""
    return without_skirt(scan, shape, T_sensor_canonical, LEAST_POINTS)


class Posed(NamedTuple):
    """What is made of a batch of scans.

    Attributes:
        shapes: the network's points, canonical frame.
        T_sensor_canonical: their poses.
        points: of the complete shapes, sensor frames, those of `shapes` first.
        refined: whether they were fitted to the scans.
        surfaces: of a LiDAR's scans, where refined; what is trusted is told by them.
    """

    shapes: Float[Tensor, "B P 3"]
    T_sensor_canonical: SE3
    points: Float[Tensor, "B Q 3"]
    refined: bool = False
    surfaces: Sequence[Surface] = ()

    @classmethod
    def of(cls, found: Found) -> "Posed":
        """As the network says."""
        T_sensor_canonical = SE3(found.rotation, found.translation)
        return cls(found.shapes, T_sensor_canonical, T_sensor_canonical.apply(found.shapes))


def refined(
    looked: Looked,
    up: Float[Tensor, "3"] | None,
    settings: ModelSettings,
    config: RefineConfig,
    device: torch.device,
    *,
    dense: bool,
) -> Posed:
    """Shapes and poses fitted to the scans on a device (`refine.py`); `up` as there."""
    seen, found = [sorted_points(one) for one in looked.seen], looked.found
    on_device = (part.to(device) for part in found[:3])
    up = None if up is None else up.to(device)
    done = refine(seen, *on_device, mirror=settings.network.mirror, up=up, config=config)
    done = Refined(*(part.cpu() for part in done))
    T_sensor_canonical = SE3(done.rotation, done.translation)
    posed = T_sensor_canonical.to(torch.float32).apply(done.shapes)
    shown = surfaces(seen, done.rotation) if settings.sensor == "lidar" else ()
    points = denser(posed, partners(found.shapes, config.partner)) if dense else posed
    return Posed(done.shapes, T_sensor_canonical, points, True, shown)


def completed(
    looked: Looked,
    i: int,
    posed: Posed,
    sensor: Sensor | None,
    settings: ModelSettings,
    config: InferenceConfig,
) -> Completion:
    """Scan `i` of those looked at."""
    scan, seen, found, sights = looked.scans[i], looked.seen[i], looked.found, looked.sights
    said = glance_of(scan, sensor, *found.said(i), settings, config.reasons)
    shape, T_sensor_can, points = posed.shapes[i], posed.T_sensor_canonical[i], posed.points[i]
    whole, solid, standing = points.numpy(), shape, None
    shows = with_its_scan(whole, shape, seen, T_sensor_can, settings, config.refine)
    if sights is not None:
        alone = sights.part([i])
        solid = without_free_space(shape, stack([T_sensor_can]), alone)
        standing = alone.of(whole, 0)
    box, odd = box_seen(solid, T_sensor_can, seen, settings, config.box), ()
    if settings.sensor == "lidar":
        odd = reasons_of_object(scan, seen, shows, box, settings.unit, config.reasons)
    done = Completion(
        points=shows,
        pose=T_sensor_can.to(torch.float64).owned(),
        box=box,
        confidence=said.confidence,
        branch=said.branch,
        cost=said.cost,
        refined=posed.refined,
        warning=said.warning,
        reasons=(*said.reasons, *odd),
        features=said.features,
    )
    if not posed.surfaces:
        return judged(done, None, None, settings, config.reasons)
    rival = float(found.features[i, -1])
    evidence = scan_features(done, seen, posed.surfaces[i], rival, standing)
    trust = settings.trust
    return judged(done, trust and trust.scan, evidence, settings, config.reasons)
