# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Inside a program that set torch otherwise: the same results, and its settings stay as they were.

Of default types: kernels wrote float32 into memory of that type, and past its end where it was
smaller.
"""

from contextlib import contextmanager

import numpy as np
import pytest
import torch
from tests.models import scan

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.ops.device import plain_torch
from wildshape.ops.nearest import nearest_k

SCANS = [scan(seed, 300) for seed in range(3)]


@contextmanager
def default_type(dtype):
    torch.set_default_dtype(dtype)
    try:
        yield
    finally:
        torch.set_default_dtype(torch.float32)


@contextmanager
def coarse_products():
    torch.set_float32_matmul_precision("medium")
    try:
        yield
        assert torch.get_float32_matmul_precision() == "medium"
    finally:
        torch.set_float32_matmul_precision("highest")


def autocast():
    return torch.autocast("cpu", dtype=torch.bfloat16)


AROUND = {
    "float64": lambda: default_type(torch.float64),
    "float16": lambda: default_type(torch.float16),
    "autocast": autocast,
    "coarse": coarse_products,
    "device": lambda: torch.device("meta"),  # as `torch.set_default_device` of a GPU
    "inference": torch.inference_mode,
}


def everything(model):
    """Bytes and numbers of all that a model makes of the scans."""
    moved = model.register(SCANS[0], SCANS[1])
    done = [model.complete(SCANS[0]), *model.complete_track(SCANS)]
    found = [(one.points.tobytes(), np.asarray(one.pose).tobytes()) for one in done]
    trusted = [(one.confidence, one.box, one.evidence) for one in done]
    corners = [one.box.corners.tobytes() for one in done]
    read = SE3.from_matrix(moved.matrix) @ SE3.identity()
    fused = model.fuse(SCANS).tobytes()
    return found, trusted, corners, np.asarray(read).tobytes(), moved.inlier_ratio, fused


@pytest.fixture(scope="module")
def expected():
    return everything(load())


@pytest.mark.parametrize("around", AROUND)
def test_a_program_that_set_torch_otherwise(expected, around):
    with AROUND[around]():
        found = everything(load())
    assert found == expected


@pytest.mark.parametrize("dtype", [torch.float16, torch.float64])
def test_neighbours_are_float32_whatever_is_the_default(dtype):
    points = torch.from_numpy(np.stack(SCANS))
    usual = nearest_k(points, points, 4).distance_squared
    with default_type(dtype):
        found = nearest_k(points, points, 4).distance_squared
    assert found.dtype == torch.float32
    assert torch.equal(found, usual)


def test_products_are_float32_whatever_is_set():
    on_cpu = torch.backends.mkldnn.matmul  # pyright: ignore[reportAttributeAccessIssue]
    for kind in (torch.backends.cuda.matmul, on_cpu):
        with coarse_products(), plain_torch():
            assert kind.fp32_precision == "ieee"


def test_poses_can_have_gradients():
    model, points = load(), torch.ones(4, 3, dtype=torch.float64, requires_grad=True)
    poses = [one.pose for one in (model.complete(SCANS[0]), *model.complete_track(SCANS))]
    for pose in (*poses, model.register(SCANS[0], SCANS[1]).T_target_source):
        (gradient,) = torch.autograd.grad(pose.apply(points).sum(), points)
        torch.testing.assert_close(gradient, pose.rotation.sum(0).expand(4, 3))


def test_loading_draws_no_random_numbers():
    before = torch.get_rng_state()
    load()
    assert torch.equal(torch.get_rng_state(), before)
