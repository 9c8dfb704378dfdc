# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rotations: 6D representation, quaternions, angles, random draws.

A rotation is a matrix `(..., 3, 3)` that acts on column vectors: `x_a = R_a_b x_b`.
"""

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

_EPS = 1e-8


def rotation_from_6d(vectors: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch 3 3"]:
    """Gram-Schmidt on two 3-vectors, the matrix's first two columns (Zhou et al. 2019, eq. 15)."""
    first, second = vectors[..., :3], vectors[..., 3:]
    x = torch.nn.functional.normalize(first, dim=-1, eps=_EPS)
    y = second - (x * second).sum(-1, keepdim=True) * x
    y = torch.nn.functional.normalize(y, dim=-1, eps=_EPS)
    return torch.stack((x, y, torch.linalg.cross(x, y)), dim=-1)


def rotation_to_6d(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 6"]:
    """The first two columns, one after the other: the inverse of `rotation_from_6d`."""
    return torch.cat((rotation[..., :, 0], rotation[..., :, 1]), dim=-1)


def rotation_z(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation by `angle` radians about z (yaw, counter-clockwise seen from above)."""
    cos, sin = angle.cos(), angle.sin()
    zero, one = torch.zeros_like(cos), torch.ones_like(cos)
    rows = (cos, -sin, zero, sin, cos, zero, zero, zero, one)
    return torch.stack(rows, dim=-1).reshape(*angle.shape, 3, 3)


def rotations_about(axis: int, angle: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3 3"]:
    """Right-handed turns about x (0), y (1) or z (2), radians."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.tile(np.eye(3), (len(angle), 1, 1))
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, i, j], R[:, j, i] = -np.sin(angle), np.sin(angle)
    return R


def cross_matrix(vector: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The matrix that takes the cross product with a vector: `cross_matrix(w) @ x = w x x`."""
    x, y, z = vector.unbind(-1)
    zero = torch.zeros_like(x)
    return torch.stack((zero, -z, y, z, zero, -x, -y, x, zero), dim=-1).unflatten(-1, (3, 3))


def smallest_turn(
    start: Float[np.ndarray, "3"], end: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 3"]:
    """The smallest rotation that takes one unit vector to another, by Rodrigues' formula.

    Args:
        start: unit vector.
        end: unit vector, not opposite to it.
    """
    axis = cross_matrix(torch.from_numpy(np.cross(start, end))).numpy()  # times the angle's sine
    return np.eye(3) + axis + axis @ axis / (1.0 + start @ end)


def rotation_from_vector(vector: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """The turn about a vector by its length in radians (Rodrigues)."""
    angle = vector.norm(dim=-1)[..., None, None]
    cross = cross_matrix(vector)
    eye = torch.eye(3, dtype=vector.dtype, device=vector.device)
    half = torch.sinc(angle / (2 * torch.pi))  # of it: (1 - cos a) / a^2 without cancellation
    return eye + torch.sinc(angle / torch.pi) * cross + half.square() / 2 * cross @ cross


def rotation_from_quaternion(wxyz: Float[Tensor, "*batch 4"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrix of a quaternion in w, x, y, z order; it is normalised first."""
    w, x, y, z = torch.nn.functional.normalize(wxyz, dim=-1, eps=_EPS).unbind(-1)
    rows = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )
    return torch.stack(rows, dim=-1).reshape(*wxyz.shape[:-1], 3, 3)


def quaternion_from_rotation(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 4"]:
    """Unit quaternion w, x, y, z with w >= 0.

    Each row of the 4x4 matrix below is the quaternion times one of its own components; the row
    with the largest component is taken, which is safe at every angle (Shepperd 1978).
    """
    m = rotation
    d0, d1, d2 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    a = m[..., 2, 1] - m[..., 1, 2]
    b = m[..., 0, 2] - m[..., 2, 0]
    c = m[..., 1, 0] - m[..., 0, 1]
    d = m[..., 1, 0] + m[..., 0, 1]
    e = m[..., 0, 2] + m[..., 2, 0]
    f = m[..., 2, 1] + m[..., 1, 2]
    rows = torch.stack(
        (
            torch.stack((1 + d0 + d1 + d2, a, b, c), -1),
            torch.stack((a, 1 + d0 - d1 - d2, d, e), -1),
            torch.stack((b, d, 1 - d0 + d1 - d2, f), -1),
            torch.stack((c, e, f, 1 - d0 - d1 + d2), -1),
        ),
        dim=-2,
    )
    largest = rows.diagonal(dim1=-2, dim2=-1).argmax(-1)
    index = largest[..., None, None].expand(*largest.shape, 1, 4)
    q = torch.nn.functional.normalize(rows.gather(-2, index).squeeze(-2), dim=-1)
    return torch.where(q[..., :1] < 0, -q, q)


def rotation_angle(rotation: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch"]:
    """Angle in radians, 0 to pi: `2 acos |<q, 1>|` (METHOD 8), computed as `2 atan2(|v|, |w|)`.

    The two are equal; atan2 keeps its digits near zero, where acos loses half of them.
    """
    q = quaternion_from_rotation(rotation)
    return 2 * torch.atan2(q[..., 1:].norm(dim=-1), q[..., 0].abs())


def rotation_from_uniform(draws: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3 3"]:
    """Uniform draws from SO(3) of three numbers uniform in [0, 1) each (Shoemake 1992)."""
    share, first, second = draws.unbind(-1)
    a, b = 2 * torch.pi * first, 2 * torch.pi * second
    low, high = (1 - share).sqrt(), share.sqrt()
    return rotation_from_quaternion(
        torch.stack((high * b.cos(), low * a.sin(), low * a.cos(), high * b.sin()), dim=-1)
    )


def random_rotation(count: int, generator: torch.Generator) -> Float[Tensor, "count 3 3"]:
    """Uniform draws from SO(3): normalised Gaussian quaternions (Shoemake 1992)."""
    return rotation_from_quaternion(torch.randn(count, 4, generator=generator))


def random_yaw(count: int, generator: torch.Generator) -> Float[Tensor, "count 3 3"]:
    """Rotations about z by angles uniform in a full turn."""
    return rotation_z(2 * torch.pi * torch.rand(count, generator=generator))
