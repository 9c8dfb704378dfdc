# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is said of DPC's poses."""

from typing import Any

import torch

from experiments import dpc_toy
from wildshape.geometry.transforms.rotation import rotation_z


def test_a_view_is_not_a_pair_with_itself(monkeypatch):
    apart = rotation_z(torch.deg2rad(torch.tensor((0.0, 90.0, 180.0), dtype=torch.float64)))
    monkeypatch.setattr(dpc_toy, "canonical", lambda method, track: apart)
    nobody: Any = None
    assert dpc_toy.right_share(nobody, nobody, nobody)["pairs_within_15"] == 0
