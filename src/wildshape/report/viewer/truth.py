# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the viewer compares with, where a track brings it: its shape, else its scans joined."""

from wildshape.datasets.accumulate import shape_partial
from wildshape.records import Points, Track


def true_shape(track: Track) -> Points | None:
    """`(g, 3)` in the object's frame: the track's shape, or what its true poses accumulate to."""
    if track.shape is not None or track.T_sensor_object is None:
        return track.shape
    return shape_partial(track)
