# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A trained DPC, DPC-dagger or DPC-LIDAR as a row of a table (METHOD 9)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.baselines.dpc.checkpoint import DpcSettings, load_dpc
from wildshape.baselines.dpc.network import DpcNet
from wildshape.baselines.dpc.viewing_volume import (
    PinholeVolume,
    Volume,
    ahead,
    inside,
    offsets,
    scan_image,
    to_volume,
)
from wildshape.errors import BadInputError
from wildshape.geometry.projection.line_of_sight import face
from wildshape.geometry.transforms.rotation import rotation_from_quaternion
from wildshape.geometry.transforms.se3 import SE3, stack
from wildshape.records import Points, Sensor

_IN_IMAGE = 0.5  # of a scan's points must be in the image


def load(model: Path, device: str = "cpu") -> "Dpc":
    """The method of a checkpoint.

    Raises:
        BadInputError: it cannot be used; the sentence says why.
    """
    network, settings = load_dpc(model)
    return Dpc(network.to(device), settings)


@dataclass(frozen=True)
class Dpc:
    """Completes and registers from the image of a scan; the student's pose speaks."""

    network: DpcNet
    settings: DpcSettings

    @property
    def about(self) -> str:
        """What it is, and what it is told that other rows are not."""
        volume = self.settings.network.volume
        lost = "silhouettes and depths" if self.settings.depth else "silhouettes"
        lost += ", half turns tried" if self.settings.half_turn else ""
        method = f"our port of DPC ({self.settings.name}), trained on {lost}"
        if not isinstance(volume, PinholeVolume):
            return f"{method}; range images, cube of {volume.scale:g} m, radial offset of the scan"
        moved = "rotation and translation" if self.settings.network.reach else "rotation only"
        told = f"IS GIVEN the camera's distance ({volume.distance:g}) and that it looks at the"
        return f"{method}; depth images, {moved}; {told} object's true centre"

    def complete(self, points: Points, sensor: Sensor) -> Points:
        """The complete shape `(m, 3)` in the frame of `points` `(n, 3)`, metres.

        Raises:
            BadInputError: another sensor than trained on, or an object out of the image.
        """
        cloud, T_sensor_can = self._posed_cloud(points, sensor)
        return T_sensor_can.apply(cloud).float().numpy()

    def register_track(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_middle_scan`, one a scan: takes each scan to the frame of the middle scan.

        Raises:
            BadInputError: as `complete`.
        """
        poses = self.poses(scans, sensor)
        return poses[len(scans) // 2] @ poses.inverse()

    def poses(self, scans: Sequence[Points], sensor: Sensor) -> SE3:
        """`T_sensor_canonical` of each scan.

        Raises:
            BadInputError: as `complete`.
        """
        return stack([self._posed_cloud(scan, sensor)[1] for scan in scans])

    def canonical(self, points: Points, sensor: Sensor) -> tuple[Points, SE3]:
        """Canonical shape `(m, 3)` in metres, and `T_sensor_canonical`.

        Raises:
            BadInputError: as `complete`.
        """
        cloud, T_sensor_canonical = self._posed_cloud(points, sensor)
        return cloud.float().numpy(), T_sensor_canonical

    @torch.inference_mode()
    def _posed_cloud(self, points: Points, sensor: Sensor) -> tuple[Float[Tensor, "n 3"], SE3]:
        """Canonical points in metres, and `T_sensor_canonical`; float64."""
        volume = self.settings.network.volume
        _refuse_other(sensor, volume)
        device = next(self.network.parameters()).device
        scan = torch.from_numpy(np.ascontiguousarray(points)).to(device)[None]
        turned, turn, offset = _before(scan, volume)
        cube = to_volume(turned, offset, volume)
        _refuse_outside(cube)
        code = self.network.encode(scan_image(cube, self.settings.network.image))
        cloud, _ = self.network.cloud(code)
        poses = self.network.poses(code)
        rotation = turn.mT @ rotation_from_quaternion(poses.student)[0]
        middle = turn.mT @ (volume.scale * poses.translation + ahead(offset, volume))[0]
        pose = SE3(rotation.cpu().double(), middle.cpu().double())
        return (volume.scale * cloud[0]).cpu().double(), pose


def _before(
    scan: Float[Tensor, "1 n 3"], volume: Volume
) -> tuple[Float[Tensor, "1 n 3"], Float[Tensor, "3 3"], Float[Tensor, "1"]]:
    """The scan in the image's frame, how it was turned, and how far the cube's middle is."""
    if isinstance(volume, PinholeVolume):
        return scan, torch.eye(3, device=scan.device), offsets(scan[:, 0], volume)
    found = face(scan[0])
    return scan @ found.turn.mT, found.turn, offsets(found.centre[None], volume)


def _refuse_other(sensor: Sensor, volume: Volume) -> None:
    wanted = "camera" if isinstance(volume, PinholeVolume) else "lidar"
    if sensor.kind != wanted:
        raise BadInputError(
            f"a {sensor.kind} scan, but this DPC was trained for {wanted} scans; choose the other."
        )


def _refuse_outside(cube: Float[Tensor, "1 n 3"]) -> None:
    if float(inside(cube).float().mean()) < _IN_IMAGE:
        raise BadInputError(
            "the object lies outside of DPC's image: it needs a camera that looks at the object"
            " from the distance trained with."
        )
