# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""All of `Predictor.complete` but the box, as one pure module: raw scans in, shapes out."""

from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import face, roll, roll_angle
from wildshape.inference.config import HypothesisRule
from wildshape.inference.export.plain_confidence import confidence_plain, look_plain
from wildshape.inference.export.plain_scores import score_plain
from wildshape.inference.single_scans import in_sensor_frame
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.choose_hypothesis import NetworkInput, choose_hypothesis
from wildshape.method.network import ShapePoseNet


class Completed(NamedTuple):
    """What the graph gives; sensor frames, metres.

    Attributes:
        points: complete shapes.
        rotation: of `T_sensor_canonical`.
        translation: of the same.
        confidence: 0 to 1.
        cost: label-free cost.
        branch: that spoke.
    """

    points: Float[Tensor, "B P 3"]
    rotation: Float[Tensor, "B 3 3"]
    translation: Float[Tensor, "B 3"]
    confidence: Float[Tensor, "B"]
    cost: Float[Tensor, "B"]
    branch: Int[Tensor, "B"]


OUTPUTS = Completed._fields
# Canonical shape, rotation and translation in the sensor frame, cost, branch, features.
_Look = tuple[Tensor, ...]
_PARTS = 6
_DEFAULT = HypothesisRule()


class CompletionGraph(nn.Module):
    """A network with centring, turning, branch scoring and confidence around it."""

    def __init__(
        self, network: ShapePoseNet, settings: ModelSettings, rule: HypothesisRule = _DEFAULT
    ) -> None:
        super().__init__()
        self.network, self.settings, self.rule = network, settings, rule

    def forward(
        self, scans: Float[Tensor, "B N 3"], drawn: Int[Tensor, "B M"]
    ) -> Completed | tuple[Tensor, ...]:
        """Complete scans of the same number of points.

        While it is traced the answer is a plain tuple, the only one that a file can hold.

        Args:
            scans: sensor frame, metres.
            drawn: which of its points the network sees; all count where a scan is centred.
        """
        shape, rotation, translation, cost, branch, features = self._complete(scans, drawn)
        points = shape @ rotation.mT + translation[:, None]
        confidence = confidence_plain(scans, cost, features, self.settings)
        found = (points, rotation, translation, confidence, cost, branch)
        return found if torch.compiler.is_exporting() else Completed(*found)

    def _complete(self, scans: Tensor, drawn: Tensor) -> _Look:
        sampled = scans.gather(1, drawn[..., None].expand(-1, -1, 3))
        if not self.settings.facing:
            turn = torch.eye(3).expand(scans.shape[0], 3, 3)
            return self._look(sampled, scan_centre(scans, self.settings.sensor), turn)
        turn, centre = face(scans, sensor_kind=self.settings.sensor)
        first = self._look(sampled @ turn.mT, centre, turn)
        angle = roll_angle(turn @ first[1])
        tilted = angle.abs() > self.rule.upright_rad
        state = (*first, sampled, turn, centre, angle, tilted)
        if torch.compiler.is_exporting():
            return torch.cond(tilted.any(), self._look_again, _keep, state)
        return self._look_again(*state) if bool(tilted.any()) else first

    def _look_again(self, *state: Tensor) -> _Look:
        """Tilted scans rolled upright and seen again (`single_scans.py`)."""
        first, (sampled, turn, centre, angle, tilted) = state[:_PARTS], state[_PARTS:]
        upright = roll(angle) @ turn
        second = self._look(sampled @ upright.mT, centre, upright)
        cheaper = tilted & (second[3] < first[3])
        return tuple(
            torch.where(cheaper.view(-1, *(1,) * (old.ndim - 1)), new, old)
            for old, new in zip(first, second)
        )

    def _look(self, turned: Tensor, centre: Tensor, turn: Tensor) -> _Look:
        """Shapes, and the poses of the hypotheses that speak."""
        sizes = torch.full(turned.shape[:1], turned.shape[1])
        unseen = turned.new_zeros(turned.shape[0], 0, 6)
        inputs = NetworkInput(turned - centre[:, None], centre, turn, sizes, unseen)
        found = choose_hypothesis(self.network, inputs.scans, centre, self.settings, score_plain)
        features = look_plain(found.posed, found.scores, found.poses.log_belief, found.believed)
        return tuple(in_sensor_frame(found, inputs, self.settings, features))


def _keep(*state: Tensor) -> _Look:
    """Nothing is tilted: the first look stands."""
    return tuple(part.clone() for part in state[:_PARTS])
