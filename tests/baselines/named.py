# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines by name, and their errors on a track."""

from typing import Any

import pytest
from tests.cars import poses_of

from wildshape.baselines.named import baseline
from wildshape.errors import MissingExtraError
from wildshape.evaluation.metrics import registration_error


def named(name) -> Any:
    """The baseline, where its library is installed."""
    try:
        return baseline(name)
    except MissingExtraError as error:
        pytest.skip(str(error))


def errors(method, track):
    T_middle_scan = method.register_track(list(track.scans), track.sensor)
    poses = poses_of(track)
    return registration_error(T_middle_scan, poses, poses[track.middle])
