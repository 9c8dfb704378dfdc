# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The cube before a sensor in which DPC lives: image right, image down, away from the sensor.

Each coordinate reaches from -0.5 to 0.5, and the rays of the sensor run along the third one, so
that an image is a sum over it (Insafutdinov and Dosovitskiy 2018, section 3; paper's supplement).
"""

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d

from wildshape.geometry.projection.spherical import to_spherical

_NEAREST = 0.1  # of the distance: nothing is projected that comes closer


@dataclass(frozen=True)
class PinholeVolume:
    """A camera that looks at the object from a known distance; frame x right, y down, z forward.

    Attributes:
        distance: of the object's origin, on the optical axis, metres.
        focal: focal length over the width of the image.
        scale: edge of the cube that the object's origin is the middle of, metres.
    """

    distance: float = 2.0
    focal: float = 1.875
    scale: float = 1.0


@dataclass(frozen=True)
class PolarVolume:
    """DPC-LIDAR: azimuth, pitch and range in a frame turned to face the object (x forward, z up).

    The angles are multiplied by the radial offset, so that a pixel is as wide on an object near by
    as on one far away.

    Attributes:
        scale: edge of the cube, metres; the paper's is 6.
    """

    scale: float = 6.0


Volume = PinholeVolume | PolarVolume


class RangeImage(NamedTuple):
    """What a sensor sees: square images, `v` down and `u` right.

    Attributes:
        silhouette: share of each pixel that the object covers.
        depth: third coordinate of the volume, `beyond` where nothing is.
    """

    silhouette: Float[Tensor, "*batch S S"]
    depth: Float[Tensor, "*batch S S"]


def to_volume(
    points: Float[Tensor, "*batch n 3"], offset: Float[Tensor, "*batch"], volume: Volume
) -> Float[Tensor, "*batch n 3"]:
    """Coordinates in the cube; outside of +-0.5 is outside of the image.

    Args:
        points: in the frame of the volume's sensor, metres.
        offset: distance of the cube's middle from the sensor, metres.
        volume: of the sensor.
    """
    middle = offset[..., None]
    if isinstance(volume, PinholeVolume):
        x, y, z = points.unbind(-1)
        ray = volume.focal / torch.maximum(z, _NEAREST * middle)
        return torch.stack((x * ray, y * ray, (z - middle) / volume.scale), dim=-1)
    polar = to_spherical(points)
    across = -middle / volume.scale
    away = (polar.range - middle) / volume.scale
    return torch.stack((polar.azimuth * across, polar.pitch * across, away), dim=-1)


def offsets(centre: Float[Tensor, "*batch 3"], volume: Volume) -> Float[Tensor, "*batch"]:
    """How far the cube's middle is from the sensor, metres: what DPC has to be told.

    Args:
        centre: of a scan, found without labels; its distance is the paper's radial offset.
        volume: a camera's distance is known instead.
    """
    if isinstance(volume, PinholeVolume):
        return torch.full_like(centre[..., 0], volume.distance)
    return centre.norm(dim=-1)


def ahead(offset: Float[Tensor, "*batch"], volume: Volume) -> Float[Tensor, "*batch 3"]:
    """The middle of the cube in the sensor's frame."""
    zero = torch.zeros_like(offset)
    pinhole = isinstance(volume, PinholeVolume)
    return torch.stack((zero, zero, offset) if pinhole else (offset, zero, zero), dim=-1)


def upwards(volume: Volume, like: Tensor) -> Float[Tensor, "3"]:
    """The direction that is up in the frame of the volume's sensor."""
    up = (0.0, -1.0, 0.0) if isinstance(volume, PinholeVolume) else (0.0, 0.0, 1.0)
    return torch.tensor(up, dtype=like.dtype, device=like.device)


def beyond(size: int) -> float:
    """The depth of a ray that meets nothing: one voxel behind the last of `size`."""
    return 0.5 + 0.5 / size


def place(
    cloud: Float[Tensor, "... n 3"],
    rotation: Float[Tensor, "... 3 3"],
    middle: Float[Tensor, "... 3"],
    volume: Volume,
) -> Float[Tensor, "... n 3"]:
    """Canonical points of the unit cube in the sensor's frame, metres, batches broadcast.

    Args:
        cloud: canonical, in edges of the cube.
        rotation: `R_sensor_canonical`.
        middle: where the canonical origin lies, metres.
        volume: its scale is taken.
    """
    return volume.scale * cloud @ rotation.mT + middle[..., None, :]


def centres(size: int, like: Tensor) -> Float[Tensor, "S"]:
    """Coordinates of the middles of `size` pixels or voxels."""
    return (torch.arange(size, dtype=like.dtype, device=like.device) + 0.5) / size - 0.5


def inside(points: Float[Tensor, "*batch n 3"]) -> Tensor:
    """Which points `(..., n)` lie in the cube."""
    return (points.abs() < 0.5).all(-1)


def scan_image(points: Float[Tensor, "B n 3"], size: int) -> RangeImage:
    """The image of a scan's points, given in the cube: the nearest point of each pixel."""
    batch = len(points)
    cell = ((points[..., :2] + 0.5) * size).floor().long().clamp(0, size - 1)
    index = cell[..., 1] * size + cell[..., 0]
    far = beyond(size)
    depth = torch.where(inside(points), points[..., 2], far)
    nearest = points.new_full((batch, size * size), far)
    nearest = nearest.scatter_reduce(1, index, depth, "amin").view(batch, size, size)
    return RangeImage((nearest < far).to(points.dtype), nearest)


def coarser(image: RangeImage, size: int) -> RangeImage:
    """The image averaged down to `size` pixels, a divisor of its own."""
    step = image.depth.shape[-1] // size
    covered = avg_pool2d(image.silhouette[:, None], step)[:, 0]
    near = avg_pool2d((image.depth * image.silhouette)[:, None], step)[:, 0]
    return RangeImage(covered, near + (1 - covered) * beyond(size))
