# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A teacher that learned little."""

import pytest
from tests.training.worker import FEW_STEPS

from wildshape.training.loop import fit, setup


@pytest.fixture(scope="module")
def teacher(car_store, tmp_path_factory):
    folder = tmp_path_factory.mktemp("teacher")
    return fit(setup(FEW_STEPS, car_store, folder, seed=1))
