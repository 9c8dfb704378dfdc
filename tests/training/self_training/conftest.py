# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A teacher that learned little, and its targets."""

import pytest
from tests.training.self_training.taught import NOT_KEPT, sampler_of
from tests.training.worker import FEW_STEPS

from wildshape.training.loop import fit, setup
from wildshape.training.self_training.pseudo_labels import fused_targets


@pytest.fixture(scope="module")
def teacher(car_store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("teacher")
    return fit(setup(FEW_STEPS, car_store, folder, seed=1))


@pytest.fixture(scope="module")
def targets(car_store, teacher):
    return fused_targets(teacher, sampler_of(car_store), parts=NOT_KEPT)
