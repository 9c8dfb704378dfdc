# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""DPC's losses: images compared, the best of several poses taught, and a student of the winners."""

from typing import NamedTuple

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.nn.functional import normalize

from wildshape.baselines.dpc.occupancy import project
from wildshape.baselines.dpc.viewing_volume import RangeImage, Volume, to_volume
from wildshape.geometry.transforms.rotation import rotation_from_quaternion

_PIXELS = 64**2  # of the authors' images, over which they sum


class Rendering(NamedTuple):
    """How shapes are turned into images.

    Attributes:
        volume: of the sensor.
        size: voxels along an edge, and pixels of an image.
        sigma: of the smoothing, voxels.
        depth: weight of the depth image beside the silhouette.
    """

    volume: Volume
    size: int
    sigma: float
    depth: float


class Hindsight(NamedTuple):
    """The best candidate of each view.

    Attributes:
        loss: of the winners, with a graph; the mean over the views.
        silhouette: its first part.
        depth: its second part, weighted.
        winner: row of the candidate.
    """

    loss: Tensor
    silhouette: Tensor
    depth: Tensor
    winner: Int[Tensor, "B"]


def image_costs(
    rendered: RangeImage, observed: RangeImage, depth: float
) -> tuple[Float[Tensor, "B"], Float[Tensor, "B"]]:
    """Half the squared differences of silhouettes and, weighted, depths; as of 64 x 64 pixels."""
    squared = [(a - b).square().flatten(1).mean(1) for a, b in zip(rendered, observed, strict=True)]
    silhouette, away = (0.5 * _PIXELS * mean for mean in squared)
    return silhouette, depth * away


def hindsight(
    posed: Float[Tensor, "B K n 3"],
    offset: Float[Tensor, "B"],
    observed: RangeImage,
    rendering: Rendering,
    strength: Float[Tensor, "B"],
) -> Hindsight:
    """Every candidate is projected, and the one whose image is nearest is differentiated.

    Args:
        posed: the shape under each candidate pose, sensor's frame, metres.
        offset: distance of the cube's middle, metres.
        observed: image of each view, `rendering.size` pixels wide.
        rendering: how images are made.
        strength: of each view's occupancy.
    """
    winner = cheapest(posed, offset, observed, rendering, strength)
    silhouette, depth = _costs(chosen(posed, winner), offset, observed, rendering, strength)
    silhouette, depth = silhouette.mean(), depth.mean()
    return Hindsight(silhouette + depth, silhouette.detach(), depth.detach(), winner)


@torch.no_grad()
def cheapest(
    posed: Float[Tensor, "B K n 3"],
    offset: Float[Tensor, "B"],
    observed: RangeImage,
    rendering: Rendering,
    strength: Float[Tensor, "B"],
) -> Int[Tensor, "B"]:
    """Row of the candidate whose image is nearest; arguments as of `hindsight`."""
    each = (_costs(one, offset, observed, rendering, strength) for one in posed.unbind(1))
    costs = [silhouette + depth for silhouette, depth in each]
    return torch.stack(costs, dim=1).argmin(1)


def chosen(candidates: Float[Tensor, "B K *rest"], row: Int[Tensor, "B"]) -> Tensor:
    """One candidate of each view."""
    return candidates[torch.arange(len(row), device=row.device), row]


def _costs(
    posed: Tensor, offset: Tensor, observed: RangeImage, rendering: Rendering, strength: Tensor
) -> tuple[Tensor, Tensor]:
    points = to_volume(posed, offset, rendering.volume)
    rendered = project(points, rendering.size, rendering.sigma, strength)
    return image_costs(rendered, observed, rendering.depth)


def student_loss(student: Float[Tensor, "B 4"], teacher: Float[Tensor, "B 4"]) -> Float[Tensor, ""]:
    """Squared sine of half the angle between unit quaternions; the teacher gets no gradient."""
    return (1 - (student * teacher.detach()).sum(-1).square()).mean()


def nearest(poses: Float[Tensor, "B K 4"], teacher: Float[Tensor, "B 4"]) -> Float[Tensor, "B 4"]:
    """Of each view's unit quaternions the one at the least angle to the teacher."""
    likeness = (poses * teacher[:, None]).sum(-1).abs()
    return chosen(poses, likeness.argmax(1))


def half_turned(pose: Float[Tensor, "B 4"], axis: Float[Tensor, "3"]) -> Float[Tensor, "B 4"]:
    """The pose of the shape turned by 180 degrees about an axis of its own.

    Args:
        pose: unit quaternions w, x, y, z, `R_sensor_canonical`.
        axis: unit vector, canonical frame.
    """
    scalar, vector = pose[:, :1], pose[:, 1:]
    turned = scalar * axis + torch.linalg.cross(vector, axis.expand_as(vector))
    return torch.cat((-(vector @ axis)[:, None], turned), dim=1)


def common_up(pose: Float[Tensor, "B 4"], up: Float[Tensor, "3"]) -> Float[Tensor, "3"]:
    """The canonical direction that, on average, points up: sensors are held upright.

    Args:
        pose: unit quaternions w, x, y, z, `R_sensor_canonical`.
        up: unit vector, sensor frame.
    """
    return normalize((rotation_from_quaternion(pose).mT @ up).mean(0), dim=0)
