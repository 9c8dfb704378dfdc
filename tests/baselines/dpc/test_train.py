# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import pytest

from wildshape.baselines.dpc.train import dpc_recipe
from wildshape.errors import BadInputError
from wildshape.training.options import TrainingOptions


def test_a_preset_that_is_none_of_dpc_is_refused_in_a_sentence():
    with pytest.raises(BadInputError, match="dpc-lidar"):
        dpc_recipe(TrainingOptions(preset="default"))
