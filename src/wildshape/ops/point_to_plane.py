# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What points say of the motion that takes them onto planes: the one door, and its two backends.

A Gauss-Newton step of point-to-plane registration (Chen and Medioni 1991), robust by the kernel of
Geman and McClure.
"""

from typing import NamedTuple

import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from wildshape.ops.library import added_kernel, check_memory
from wildshape.ops.planes import check_places


class Equations(NamedTuple):
    """Of a small motion x of each scan, a turn about its centre and a shift: A x = -b.

    Attributes:
        A: of the squared distances, and b: see above.
        weight: of all its points.
    """

    A: Float[Tensor, "V 6 6"]
    b: Float[Tensor, "V 6"]
    weight: Float[Tensor, "V"]


def point_to_plane(
    points: Float[Tensor, "V n 3"],
    centre: Float[Tensor, "V 3"],
    onto: Float[Tensor, "P 3"],
    normals: Float[Tensor, "P 3"],
    counterpart: Int64[Tensor, "V n"],
    width: float,
    holding: float,
) -> Equations:
    """The equations of scans whose points are moved onto the planes of their counterparts.

    Args:
        points: of each scan, posed.
        centre: about which each is turned.
        onto: points of the surface.
        normals: of unit length, there.
        counterpart: of each point, its place on the surface.
        width: of the robust kernel.
        holding: how much a point is held along all three axes, of its normal's 1.
    """
    given = points, centre, onto, normals, counterpart, width, holding
    fits = points.device.type == "cpu" and points.dtype == torch.float32
    if fits and added_kernel("point_to_plane"):
        return point_to_plane_native(*given)
    return point_to_plane_torch(*given)


def point_to_plane_native(
    points: Float32[Tensor, "V n 3"],
    centre: Float32[Tensor, "V 3"],
    onto: Float32[Tensor, "P 3"],
    normals: Float32[Tensor, "P 3"],
    counterpart: Int64[Tensor, "V n"],
    width: float,
    holding: float,
) -> Equations:
    """By `native/point_to_plane.c`, in double precision; no gradient.

    Raises:
        IndexError: a counterpart without a point or a normal, a point without a counterpart, or a
            scan without a centre.
    """
    kernel = added_kernel("point_to_plane")
    assert kernel is not None  # whoever calls has asked
    check_places(counterpart, min(len(onto), len(normals)))
    scans, count, _ = points.shape
    if counterpart.shape != (scans, count) or len(centre) != scans:
        raise IndexError(
            f"{scans} scans of {count} points have {len(centre)} centres and counterparts"
            f" {tuple(counterpart.shape)}."
        )
    given = [part.detach().contiguous() for part in (points, centre.double(), onto, normals)]
    for part in (given[0], *given[2:]):
        check_memory("point_to_plane", part, torch.float32)
    places = counterpart.contiguous()
    A = given[1].new_empty(scans, 6, 6)
    b, weight = A.new_empty(scans, 6), A.new_empty(scans)
    kernel(
        given[0].data_ptr(),
        given[1].data_ptr(),
        scans,
        count,
        given[2].data_ptr(),
        given[3].data_ptr(),
        places.data_ptr(),
        width,
        holding,
        *(part.data_ptr() for part in (A, b, weight)),
    )
    return Equations(*(part.to(points.dtype) for part in (A, b, weight)))


def point_to_plane_torch(
    points: Float[Tensor, "V n 3"],
    centre: Float[Tensor, "V 3"],
    onto: Float[Tensor, "P 3"],
    normals: Float[Tensor, "P 3"],
    counterpart: Int64[Tensor, "V n"],
    width: float,
    holding: float,
) -> Equations:
    """The same of any floating type, on any device."""
    off, normal = points - onto[counterpart], normals[counterpart]
    kernel = (1 + off.square().sum(-1) / width**2) ** -2
    arm = points - centre[:, None]
    rows = torch.cat((torch.linalg.cross(arm, normal), normal), dim=-1)
    weighted = rows * kernel[..., None]
    residual = (off * normal).sum(-1, keepdim=True)
    A, b = weighted.mT @ rows, (weighted.mT @ residual)[..., 0]
    held, pulled = _held(arm, off, kernel)
    return Equations(A + holding * held, b + holding * pulled, kernel.sum(1))


def _held(
    arm: Float[Tensor, "V n 3"], off: Float[Tensor, "V n 3"], kernel: Float[Tensor, "V n"]
) -> tuple[Float[Tensor, "V 6 6"], Float[Tensor, "V 6"]]:
    """What points that are held along all three axes add, against sliding.

    With rows `(a x e, e)` for each axis e, the sum of the axes is in closed form: `|a|^2 - a a^T`,
    the cross matrix of a, and the identity.
    """
    weighted = arm * kernel[..., None]
    spread = weighted.mT @ arm
    eye = torch.eye(3, dtype=arm.dtype, device=arm.device)
    turning = spread.diagonal(dim1=-2, dim2=-1).sum(-1)[:, None, None] * eye - spread
    across = torch.linalg.cross(weighted.sum(1)[:, :, None], eye[None], dim=1)
    moving = kernel.sum(1)[:, None, None] * eye
    A = torch.cat((torch.cat((turning, across), 2), torch.cat((across.mT, moving), 2)), 1)
    pull = torch.linalg.cross(weighted, off).sum(1), (kernel[..., None] * off).sum(1)
    return A, torch.cat(pull, dim=-1)
