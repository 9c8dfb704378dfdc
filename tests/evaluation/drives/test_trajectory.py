# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Errors of trajectories by hand."""

import numpy as np
import pytest
import torch

from wildshape.evaluation.drives.trajectory import trajectory_error
from wildshape.geometry.transforms.rotation import rotation_from_uniform, rotation_z
from wildshape.geometry.transforms.se3 import SE3


def _along_x(places: list[float], beside: list[float] | None = None) -> SE3:
    y = beside or [0.0] * len(places)
    translation = torch.tensor([(a, b, 0.0) for a, b in zip(places, y)], dtype=torch.float64)
    return SE3(torch.eye(3, dtype=torch.float64).expand(len(places), 3, 3), translation)


def test_drift_in_percent_of_the_way() -> None:
    true = _along_x([0, 10, 20, 30])
    found = trajectory_error(_along_x([0, 10.1, 20.2, 30.3]), true)
    assert found is not None
    assert found.way_m == pytest.approx(30)
    assert found.drift_percent == pytest.approx(1.0)
    assert found.rpe_m == pytest.approx(0.1)
    assert found.rpe_deg == pytest.approx(0.0, abs=1e-4)
    assert found.ate_m == pytest.approx(np.sqrt(np.mean([0.15**2, 0.05**2, 0.05**2, 0.15**2])))


def test_the_worlds_may_be_any() -> None:
    true = _along_x([0, 4, 8, 12], [0, 0, 1, 3])
    R = rotation_from_uniform(torch.tensor((0.3, 0.2, 0.9), dtype=torch.float64))
    T_other_world = SE3(R, torch.tensor((5.0, -3.0, 2.0), dtype=torch.float64))
    found = trajectory_error(SE3.from_matrix(T_other_world.matrix @ true.matrix), true)
    assert found is not None
    assert found.drift_percent == pytest.approx(0, abs=1e-9)
    assert found.ate_m == pytest.approx(0, abs=1e-9)
    assert found.rpe_m == pytest.approx(0, abs=1e-9)


def test_a_wrong_turn_at_the_start_bends_the_way_to_its_end() -> None:
    """Seen from the first pose the end is off by 2 sin(1 degree / 2) of the way; aligned, not."""
    true = _along_x([0, 20, 40])
    turn = SE3(rotation_z(torch.tensor(np.radians(1.0))), torch.zeros(3, dtype=torch.float64))
    bent = SE3.from_matrix(turn.matrix @ true.matrix)
    start = SE3(true.rotation[:1], true.translation[:1])
    mixed = SE3(
        torch.cat((start.rotation, bent.rotation[1:])),
        torch.cat((start.translation, bent.translation[1:])),
    )
    found = trajectory_error(mixed, true)
    assert found is not None
    assert found.drift_percent == pytest.approx(200 * np.sin(np.radians(0.5)), rel=1e-6)
    assert found.ate_m == pytest.approx(0, abs=1e-9)
    assert found.rpe_deg == pytest.approx(np.sqrt(0.5), rel=1e-4)


def test_who_stands_does_not_drift() -> None:
    found = trajectory_error(_along_x([0, 0.1, 0]), _along_x([0, 0, 0]))
    assert found is not None
    assert found.drift_percent is None
    assert trajectory_error(_along_x([0]), _along_x([0])) is None
