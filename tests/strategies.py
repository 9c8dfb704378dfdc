# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Hypothesis draws: rotations of every size, from a millionth of a degree to the half turn."""

import math

import torch
from hypothesis import strategies as st

from wildshape.geometry.transforms.se3 import SE3

_small = st.sampled_from([0.0, 1e-12, 1e-9, 1e-7, 1e-4])
_coordinate = st.floats(-1, 1, allow_subnormal=False)


def rotation_about(axis, angle):
    """Rodrigues' formula, float64: the tests' own way to a rotation."""
    x, y, z = (torch.as_tensor(axis, dtype=torch.float64) / math.hypot(*axis)).tolist()
    K = torch.tensor([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=torch.float64)
    # 1 - cos = 2 sin^2(a / 2) keeps its digits at tiny angles.
    return (
        torch.eye(3, dtype=torch.float64)
        + math.sin(angle) * K
        + (2 * math.sin(angle / 2) ** 2) * (K @ K)
    )


axes = st.one_of(
    st.sampled_from([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 1.0, 0.0)]),
    st.tuples(_coordinate, _coordinate, _coordinate).filter(lambda v: math.hypot(*v) > 0.1),
)
angles = st.one_of(_small, _small.map(lambda a: math.pi - a), st.floats(0, math.pi))
rotations = st.builds(rotation_about, axes, angles)


@st.composite
def poses(draw):
    """One `SE3`, up to 50 m away."""
    reach = st.floats(-50, 50, allow_subnormal=False)
    translation = torch.tensor([draw(reach) for _ in range(3)], dtype=torch.float64)
    return SE3(draw(rotations), translation)


def clouds(seed, *shape, scale=1.0):
    """A seeded Gaussian cloud, float64."""
    generator = torch.Generator().manual_seed(seed)
    return scale * torch.randn(*shape, generator=generator, dtype=torch.float64)
