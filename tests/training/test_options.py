# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Options that cannot be followed are refused before anything is written."""

from tests.refusal import refused

from wildshape.training.options import TrainingOptions
from wildshape.training.train import train


def test_an_unknown_preset_is_refused_and_the_known_ones_are_named(tmp_path, car_store):
    refused(TrainingOptions, preset="nope", match=r"--preset nope: .*default, small, views")
    dpc = TrainingOptions(preset="dpc-lidar")  # has a training of its own
    refused(train, car_store.path, tmp_path / "run", dpc, match="--preset dpc-lidar: is unknown")
    assert not list(tmp_path.glob("run/*"))
