# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The boxes of a scene at any of its frames."""

import pytest

from wildshape.datasets.nuscenes.scene import Frame, Labelled, Scene
from wildshape.geometry.transforms.se3 import SE3


@pytest.mark.parametrize("sweep", [0, 3])
def test_before_the_first_and_after_the_last_key_frame_there_are_no_boxes(sweep):
    pose = SE3.identity()
    box = {"car": Labelled((4.0, 2.0, 1.5), pose)}
    frames = tuple(Frame(f"{t}.bin", t, t != sweep, 10**5 * t, pose, "") for t in range(4))
    scene = Scene("scene", frames, {t: box for t in range(4) if t != sweep}, {"car": "car"})
    assert [bool(scene.boxes_at(frame)) for frame in frames] == [t != sweep for t in range(4)]
