# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Drive-bys: the ranges, speeds and headings that are promised."""

import numpy as np
import pytest

from wildshape.simulate.trajectory import drive_by

_HALF = np.array((2.2, 0.9, 0.75))


_LORRY = np.array((6.0, 1.25, 1.8))


def _drives(count: int = 200, half: np.ndarray = _HALF) -> list:
    rng = np.random.default_rng(0)
    return [drive_by(1.73, half, 4.0, 30.0, rng) for _ in range(count)]


@pytest.mark.parametrize("half", [_HALF, _LORRY])
def test_ranges_steps_and_height(half: np.ndarray) -> None:
    """Nor does the sensor pass through a lorry that stands across the road."""
    for drive in _drives(half=half):
        T = drive.T_object_sensor
        if len(T) < 2:
            continue
        ground_range = np.hypot(T[:, 0, 3], T[:, 1, 3])
        assert ground_range.min() >= 4.0 - 1e-9
        assert ground_range.max() <= 30.0 + 1e-9
        np.testing.assert_allclose(T[:, 2, 3], 1.73 - half[2], atol=0.08)
        assert (np.abs(T[:, :2, 3]) - half[:2]).max(1).min() > 0.8
        step = np.linalg.norm(np.diff(T[:, :2, 3], axis=0), axis=1)
        assert np.median(step) >= 0.29
        assert np.median(step) <= 1.21
        np.testing.assert_allclose(T[:, :3, :3] @ T[:, :3, :3].mT, [np.eye(3)] * len(T), atol=1e-9)


def test_turns_turn_and_straights_do_not() -> None:
    turned: dict[str, list[float]] = {"straight": [], "bend": [], "turn": []}
    for drive in _drives():
        if len(drive.T_object_sensor) < 2:
            continue
        yaw = np.arctan2(drive.T_object_sensor[:, 1, 0], drive.T_object_sensor[:, 0, 0])
        turned[drive.kind].append(abs(float(np.degrees(np.unwrap(yaw)[-1] - np.unwrap(yaw)[0]))))
    assert max(turned["straight"]) < 3
    assert np.median(turned["bend"]) > 20
    assert np.median(turned["turn"]) > 80


def test_cars_are_parked_along_against_and_across() -> None:
    relative = []
    for drive in _drives(400):
        if drive.kind == "straight" and len(drive.T_object_sensor):
            R = drive.T_object_sensor[0]
            relative.append(abs(float(np.degrees(np.arctan2(R[1, 0], R[0, 0])))))
    share = np.histogram(relative, [0, 45, 135, 180])[0] / len(relative)
    np.testing.assert_allclose(share, (0.45, 0.20, 0.35), atol=0.1)
    assert min(np.abs(np.array(relative) - 45)) > 30
