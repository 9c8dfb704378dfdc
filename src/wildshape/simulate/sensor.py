# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The sensors that are simulated: spinning LiDARs with their real beam tables, a depth camera."""

from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np

    from wildshape.geometry.projection.pinhole import Intrinsics

SensorName = Literal["hdl64", "hdl32", "os1-128", "depth-camera"]
"""The names of `SENSORS`, which the command line offers."""


@dataclass(frozen=True)
class SpinningLidar:
    """A LiDAR that turns about z; frame x forward, y left, z up.

    Attributes:
        name: as on the command line.
        elevation_deg: one beam a ring, from the top down, degrees above the horizon.
        azimuth_step_deg: between two firings of one beam, degrees.
        stagger: whether the rings fire at azimuths of their own (HDL-64E) or in columns.
        noise_m: sigma of the range noise, metres.
        max_range_m: farthest return, metres.
        height_m: usual height above the road, metres.
    """

    name: str
    elevation_deg: tuple[float, ...]
    azimuth_step_deg: float
    stagger: bool
    noise_m: float
    max_range_m: float
    height_m: float

    @property
    def resolution_deg(self) -> tuple[float, float]:
        """Azimuth step and median elevation step, degrees."""
        steps = (above - below for above, below in pairwise(self.elevation_deg))
        return self.azimuth_step_deg, round(median(steps), 4)

    @property
    def ring_phase_deg(self) -> "np.ndarray":
        """`(rings,)` azimuth of each ring's first firing, degrees within one step.

        The lasers of an HDL-64E stand at azimuths of their own (its calibration file's
        `rotCorrection`); the golden ratio spreads ours over one step as evenly.
        """
        import numpy as np

        rings = len(self.elevation_deg)
        golden = (np.arange(rings) * 0.6180339887498949) % 1.0
        return golden * self.azimuth_step_deg if self.stagger else np.zeros(rings)


@dataclass(frozen=True)
class DepthCamera:
    """A pinhole depth camera looking at the object's centre (the setting of DPC).

    DPC states focal length 1.875 and distance 2.0. It is read in units of the whole image's
    width (a 60 mm lens before a 32 mm chip; the image plane reaches from -0.5 to 0.5), so
    fx = 1.875 * 128 = 240 px: an object of bounding-box diagonal 1, hence within a sphere of
    radius 0.5, reaches to 0.484 of the 0.5: it fills the image and does not leave it. In
    half-image units it would cover a quarter of the image only.

    Attributes:
        name: as on the command line.
        size: width and height, pixels; pixel i covers [i, i + 1), its centre is i + 0.5.
        focal: in image widths.
        distance: from the camera to the object's centre, in object diagonals.
        elevation_deg: range of the views' elevations, degrees.
        noise_m: sigma of the depth noise.
    """

    name: str = "depth-camera"
    size: int = 128
    focal: float = 1.875
    distance: float = 2.0
    elevation_deg: tuple[float, float] = (-20.0, 40.0)
    noise_m: float = 0.0

    @property
    def focal_px(self) -> float:
        """Focal length, fx = fy, pixels."""
        return self.focal * self.size

    @property
    def center_px(self) -> float:
        """Principal point, cx = cy, pixels."""
        return self.size / 2

    @property
    def intrinsics(self) -> "Intrinsics":
        """As of any pinhole camera."""
        from wildshape.geometry.projection.pinhole import Intrinsics

        f, c = self.focal_px, self.center_px
        return Intrinsics(f, f, c, c, self.size, self.size)


def _uniform(top: float, bottom: float, count: int) -> tuple[float, ...]:
    step = (bottom - top) / (count - 1)
    return (*(top + i * step for i in range(count - 1)), bottom)


# Velodyne HDL-64E S2: upper block of 32 at 1/3 degree, lower block of 32 at 1/2 degree.
HDL64 = SpinningLidar(
    name="hdl64",
    elevation_deg=_uniform(2.0, 2.0 - 31 / 3, 32) + _uniform(-8.83, -24.33, 32),
    azimuth_step_deg=0.1728,
    stagger=True,
    noise_m=0.02,
    max_range_m=120.0,
    height_m=1.73,
)
HDL32 = SpinningLidar(
    name="hdl32",
    elevation_deg=_uniform(10.67, -30.67, 32),
    azimuth_step_deg=0.1667,
    stagger=False,
    noise_m=0.02,
    max_range_m=70.0,
    height_m=1.84,
)
OS1_128 = SpinningLidar(
    name="os1-128",
    elevation_deg=_uniform(22.5, -22.5, 128),
    azimuth_step_deg=360 / 1024,
    stagger=False,
    noise_m=0.015,
    max_range_m=120.0,
    height_m=1.8,
)
DEPTH_CAMERA = DepthCamera()

SENSORS: dict[str, SpinningLidar | DepthCamera] = {
    s.name: s for s in (HDL64, HDL32, OS1_128, DEPTH_CAMERA)
}
