# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from wildshape.errors import BadInputError
from wildshape.io.scans.points import check_scan


def _scan(count: int, extent: float) -> np.ndarray:
    points = np.zeros((count, 3), np.float32)
    points[:, 1] = np.linspace(10, 10 + extent, count)
    return points


@pytest.mark.parametrize(
    ("points", "said"),
    [
        (_scan(0, 1), "0 finite points"),
        (_scan(15, 1), "15 finite points"),
        (np.full((40, 3), np.nan, np.float32), "0 finite points"),
        (_scan(40, 0), "all 40 points are equal"),
        (_scan(40, 4200), "millimetres .*--unit mm"),
        (_scan(40, 101), "101 m across"),
        (_scan(40, 0.004), "normalised"),
    ],
)
def test_what_is_no_scan_is_refused_by_name(points: np.ndarray, said: str) -> None:
    with pytest.raises(BadInputError, match=rf"^a\.ply: .*{said}"):
        check_scan(points, "a.ply")


def test_sane_scans_pass() -> None:
    for count, extent in ((16, 0.02), (16, 4.5), (40, 99.0)):
        check_scan(_scan(count, extent), "a.ply")
