# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from wildshape.records import Track
from wildshape.report.content import track_object


@pytest.mark.parametrize(
    ("count", "said"), [(1, "car, 200 points"), (3, "car, scan b of 3, 200 points")]
)
def test_which_scan_is_shown_is_said_where_there_are_several(count: int, said: str) -> None:
    scan = np.ones((200, 3), np.float32)
    track = Track("0007", (scan,) * count, tuple("abc"[:count]), category="car")
    assert track_object(track).subtitle == said
