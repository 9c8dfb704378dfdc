# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a network says of scans, and more looks at those that are tilted (beyond the paper).

Turned towards its object (`geometry/facing.py`), nothing of a scan's rotation is unknown but the
roll about the line of sight, and upright is what a network knows best. A scan that turns out to be
tilted is rolled by quarter turns, rolled upright as each of these looks says, and seen once more;
the answer that most of them agree on, the cheaper the better, speaks. Where sensors are usually
level, an answer in which this one is level counts as cheaper than it is: a sensor that lies on its
side is level in a wrong answer by rare chance alone.
"""

import math
from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor

from wildshape.geometry.facing import roll_angle
from wildshape.geometry.level import levelness
from wildshape.inference.facts import seen_facts
from wildshape.inference.prepare import NetworkInput
from wildshape.losses.hindsight import score_hypotheses
from wildshape.models.checkpoint import ModelSettings
from wildshape.models.shapepose import Poses, ShapePoseNet

UPRIGHT_RAD, ROLLS = 0.1, 4
_ALIKE = 2 * math.cos(math.radians(30.0)) + 1  # trace of a rotation by 30 degrees
_DEARER, _SMALLEST_M = 0.3, 1e-9
_LEVEL_NATS = 3.0  # twenty to one

Up = tuple[float, float, float] | None


class Found(NamedTuple):
    """What looks at scans give: shapes, `T_sensor_canonical`, cost, branch, and facts."""

    shapes: Float[Tensor, "B P 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    cost: Float[Tensor, "B"]
    branch: Int[Tensor, "B"]
    facts: Float[Tensor, "B F"]

    def part(self, rows: Int[Tensor, "b"]) -> "Found":
        """Some of the scans."""
        return Found(*(part[rows] for part in self))

    def replaced(self, rows: Int[Tensor, "b"], new: "Found") -> "Found":
        """With other answers for some of the scans."""
        return Found(*(old.index_copy(0, rows, part) for old, part in zip(self, new)))


def look(
    network: ShapePoseNet, settings: ModelSettings, given: NetworkInput, up: Up = None
) -> Found:
    """Shapes, and the poses of the branches that speak, from prepared scans.

    `up`: canonical direction of the z axes of level sensors, if level ones are usual.
    """
    code = network.encode(given.scans)
    shapes, poses = network.canonical(code), network.poses(code)
    back = given.turn.mT
    bonus = level_bonus(settings, back[:, None] @ poses.rotation, up)
    cost, branch, facts = _choose(settings, given, shapes, poses, bonus)
    chosen = poses.choose(branch)
    translation = back @ (chosen.translation[:, 0] + given.centres)[..., None]
    rotation = back @ chosen.rotation[:, 0]
    return Found(shapes, rotation, translation[..., 0], cost, branch, facts)


def look_well(
    network: ShapePoseNet, settings: ModelSettings, given: NetworkInput, up: Up = None
) -> Found:
    """`look`, and more looks at the scans that turn out to be tilted."""
    found = look(network, settings, given, up)
    angle = roll_angle(given.turn @ found.rotation)
    rows = torch.nonzero(angle.abs() > UPRIGHT_RAD)[:, 0]
    if len(rows) == 0:
        return found
    ways = given.part(rows.repeat_interleave(ROLLS)).rolled(quarter_turns(angle[rows]))
    first = look(network, settings, ways, up)
    upright = ways.rolled(roll_angle(ways.turn @ first.rotation))
    seen = look(network, settings, upright, up)
    cost = halved_if_level(seen.cost, seen.rotation, up)
    best = agreed(seen.rotation.unflatten(0, (-1, ROLLS)), cost.view(-1, ROLLS))
    return found.replaced(
        rows, seen.part(best + ROLLS * torch.arange(len(rows), device=best.device))
    )


def level_bonus(settings: ModelSettings, R_sensor_can: Tensor, up: Up) -> Tensor | float:
    """Metres that answers in which the sensor is level are taken for cheaper."""
    if up is None:
        return 0.0
    return settings.belief * _LEVEL_NATS * levelness(R_sensor_can, up)


def halved_if_level(cost: Tensor, R_sensor_can: Tensor, up: Up) -> Tensor:
    """Costs as `agreed` compares them, where half the cost is some twenty to one."""
    return cost if up is None else cost / (1 + levelness(R_sensor_can, up))


def quarter_turns(angle: Float[Tensor, "B"]) -> Float[Tensor, "B_times_4"]:
    """Each angle, and it with one, two and three quarter turns more."""
    turns = torch.arange(ROLLS, device=angle.device) * (2 * math.pi / ROLLS)
    return (angle[:, None] + turns).flatten()


def agreed(rotation: Float[Tensor, "B K 3 3"], cost: Float[Tensor, "B K"]) -> Int[Tensor, "B"]:
    """Which of K answers for each scan is to be believed.

    An answer's weight falls with its cost; those within 30 degrees of each other speak for each
    other. Of those that agree with the strongest, the cheapest.
    """
    least = cost.amin(1, keepdim=True).clamp_min(_SMALLEST_M)
    weight = torch.exp((least - cost) / (_DEARER * least))
    trace = torch.einsum("bkij,blij->bkl", rotation, rotation)
    alike = trace > _ALIKE
    support = (alike * weight[:, None]).sum(-1)
    strongest = support.argmax(1)
    with_it = alike[torch.arange(len(cost), device=cost.device), strongest]
    return torch.where(with_it, cost, math.inf).argmin(1)


def _choose(
    settings: ModelSettings,
    given: NetworkInput,
    shapes: Tensor,
    poses: Poses,
    bonus: Tensor | float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Cost and index of the branch with the lowest label-free cost (METHOD 3), and facts.

    A selector's belief counts too, `settings.belief` metres a nat, and `bonus` metres.
    """
    posed = poses.apply(shapes)
    scores = score_hypotheses(given.scans, given.centres, posed, settings.projection)
    cost = scores.cost(settings.beta)
    believed = cost - settings.belief * poses.log_belief - bonus
    branch = believed.argmin(-1)
    facts = seen_facts(given.scans, posed, scores, poses, believed)
    return cost.gather(1, branch[:, None])[:, 0], branch, facts
