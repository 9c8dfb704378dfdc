# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans at any roll: looked at from four sides, the answer most of them agree on."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.geometry.level import levelness
from wildshape.geometry.rotation import random_rotation, rotation_z
from wildshape.geometry.se3 import SE3
from wildshape.inference.looking import ROLLS, agreed, halved_if_level, quarter_turns
from wildshape.inference.predictor import load

SCAN = Path(__file__).parents[2] / "examples" / "scan.npy"


def test_quarter_turns_go_round_once():
    angles = quarter_turns(torch.tensor((0.1, -2.0))).view(2, ROLLS)
    torch.testing.assert_close(angles[:, 0], torch.tensor((0.1, -2.0)))
    torch.testing.assert_close(angles.diff(dim=1), torch.full((2, ROLLS - 1), math.pi / 2))


@pytest.mark.parametrize("seed", range(5))
def test_most_answers_agree_and_the_cheapest_of_them_speaks(seed):
    generator = torch.Generator().manual_seed(seed)
    right = random_rotation(1, generator)
    near = right @ rotation_z(torch.deg2rad(torch.tensor((0.0, 4.0, -6.0))))
    other = right @ rotation_z(torch.tensor([math.pi]))
    order = torch.randperm(4, generator=generator)
    rotation, cost = torch.cat((near, other))[order], torch.tensor((0.21, 0.2, 0.22, 0.19))[order]
    assert order[agreed(rotation[None], cost[None])[0]] == 1


def test_one_answer_much_cheaper_than_all_others_speaks():
    rotation = rotation_z(torch.tensor((0.0, 0.0, 0.0, math.pi)))[None]
    assert agreed(rotation, torch.tensor([[0.9, 0.9, 0.9, 0.1]]))[0] == 3
    assert agreed(rotation, torch.tensor([[0.9, 0.9, 0.9, 0.0]]))[0] == 3


def test_four_that_contradict_each_other_leave_the_cheapest():
    rotation = rotation_z(torch.arange(4) * math.pi / 2)[None]
    assert agreed(rotation, torch.tensor([[0.3, 0.2, 0.1, 0.4]]))[0] == 2


def test_the_shipped_weights_know_a_car_at_any_roll():
    points = np.load(SCAN)
    predictor = load()
    upright = predictor.complete(points).pose
    turns = random_rotation(12, torch.Generator().manual_seed(0)).double()
    still = torch.zeros(3, dtype=torch.float64)
    scans = [SE3(turn, still).apply_numpy(points) for turn in turns]
    for turn, done in zip(turns, predictor.complete_many(scans)):
        off = (turn @ upright.rotation).mT @ done.pose.rotation
        assert torch.rad2deg(torch.acos(((off.trace() - 1) / 2).clamp(-1, 1))) < 10


UP = (0.0, 0.6, 0.8)


def turned_by(degrees: float) -> torch.Tensor:
    """`R_sensor_canonical` of sensors that stand some degrees off level, at any heading."""
    level = face_up(torch.tensor(UP))
    lean = math.radians(degrees)
    tilt = torch.tensor(
        (
            (1.0, 0.0, 0.0),
            (0.0, math.cos(lean), -math.sin(lean)),
            (0.0, math.sin(lean), math.cos(lean)),
        )
    )
    return tilt @ rotation_z(torch.linspace(0, 5, 7)) @ level


def face_up(up: torch.Tensor) -> torch.Tensor:
    """A rotation whose last row is `up`."""
    across = torch.linalg.cross(up, torch.tensor((1.0, 0.0, 0.0)))
    across = across / across.norm()
    return torch.stack((torch.linalg.cross(across, up), across, up))


def test_levelness_is_one_on_the_level_a_quarter_at_ten_degrees_and_nothing_upside_down():
    at = {degrees: levelness(turned_by(degrees), UP) for degrees in (0, 2, 10, 90, 180)}
    torch.testing.assert_close(at[0], torch.ones(7))
    torch.testing.assert_close(at[10], torch.full((7,), 0.25), atol=2e-3, rtol=0)
    assert (at[2] > 0.9).all()
    assert max(at[90].max(), at[180].max()) < 1e-3


def test_of_like_answers_the_level_one_speaks_and_of_tilted_ones_all_are_as_before():
    rotation = torch.stack([turned_by(lean)[0] for lean in (170, 3, 100, 60)])[None]
    cost = torch.tensor([[0.20, 0.25, 0.21, 0.22]])
    assert agreed(rotation, cost)[0] == 0
    assert agreed(rotation, halved_if_level(cost, rotation, UP))[0] == 1
    assert agreed(rotation, halved_if_level(cost, rotation, None))[0] == 0
    far = torch.tensor([[0.20, 0.55, 0.21, 0.22]])
    assert agreed(rotation, halved_if_level(far, rotation, UP))[0] == 0
    without = rotation[:, [0, 2, 3]]
    tilted = halved_if_level(cost[:, [0, 2, 3]], without, UP)
    torch.testing.assert_close(tilted, cost[:, [0, 2, 3]], rtol=1e-3, atol=0)
