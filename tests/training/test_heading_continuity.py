# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
import torch
from tests.strategies import rotation_about

from wildshape.geometry.transforms.rotation import random_rotation
from wildshape.training.heading_continuity import turning_handicap


def branches(degrees):
    """One scan's branches, each turned about z against the reference by these angles."""
    return torch.stack([rotation_about((0.0, 0.0, 1.0), math.radians(d)) for d in degrees])


def test_branches_that_turn_the_object_around_cannot_win():
    rotation = branches([0, 80, 100, 180, -80, -100])[None]
    eye = torch.eye(3, dtype=torch.float64)[None]
    handicap = turning_handicap(rotation, eye, eye)[0].tolist()
    assert [h > 50 for h in handicap] == [False, False, True, True, False, True]
    assert [h for h in handicap if h <= 50] == [0, 0, 0]
    assert handicap[3] == pytest.approx(max(handicap))


def test_the_turn_of_training_is_taken_off():
    """Scans turned at random hold the same handicaps: poses are compared as recorded."""
    anchor = random_rotation(6, torch.Generator().manual_seed(0)).double()
    turn = random_rotation(6, torch.Generator().manual_seed(1)).double()
    relative = branches([0, 60, 120, 180])
    recorded = anchor[:, None] @ relative
    still = turning_handicap(recorded, torch.eye(3).double().repeat(6, 1, 1), anchor)
    turned = turning_handicap(turn[:, None] @ recorded, turn, anchor)
    torch.testing.assert_close(turned, still)
    assert (still == 0).tolist() == [[True, True, False, False]] * 6
