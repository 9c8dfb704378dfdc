# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How much of a registered scan lies on the other."""

import math

import numpy as np
import pytest
import torch
from tests.models import CONFIG, SETTINGS, scan
from tests.strategies import rotation_about

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.config import InferenceConfig, InlierRule
from wildshape.inference.predictor import Predictor
from wildshape.inference.registration import inlier_ratio
from wildshape.method.network import ShapePoseNet


def test_a_scan_is_registered_to_itself_by_the_identity():
    predictor = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS)
    found = predictor.register(scan(), scan())
    torch.testing.assert_close(
        found.T_target_source.matrix, torch.eye(4).double(), atol=1e-5, rtol=0
    )
    assert found.inlier_ratio == 1


def test_inlier_ratio_by_hand():
    """Reach is the lesser of 0.2 m and 5 % of the target's extent (here 10 m and 1 m)."""
    line = np.linspace(0, 1, 11, dtype=np.float32)[:, None]
    target = line * np.array([10, 0, 0], np.float32)
    source = target + np.array([0, 0.15, 0], np.float32)
    source[:4, 1] = 0.25
    one = SE3.identity()
    assert inlier_ratio(one, source, target) == pytest.approx(7 / 11)
    small = line * np.array([1, 0, 0], np.float32)
    near = small + np.array([0, 0.03, 0], np.float32)
    near[:4, 1] = 0.1
    assert inlier_ratio(one, near, small) == pytest.approx(7 / 11)
    T = SE3(rotation_about((0.0, 0.0, 1.0), math.pi), torch.tensor([10.0, 0.0, 0.0]).double())
    assert inlier_ratio(T, target, target) == 1


def test_inliers_reach_as_far_as_the_configuration_says():
    network, a, b = ShapePoseNet(CONFIG).eval(), scan(1), scan(2)
    for within_m in (0.01, 0.1):
        rule = InlierRule(within_m=within_m, within_share=1.0)
        of = Predictor(network, SETTINGS, config=InferenceConfig(inliers=rule))
        found = of.register(a, b)
        assert found.inlier_ratio == inlier_ratio(found.T_target_source, a, b, rule)
        assert found.inlier_ratio != inlier_ratio(found.T_target_source, a, b)
