# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What to simulate, in one frozen record."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from wildshape.arguments import check_fields
from wildshape.errors import BadInputError
from wildshape.simulate.sensor import SENSORS, DepthCamera, SensorName, SpinningLidar

Category = Literal["car", "airplane", "chair"]


@dataclass(frozen=True)
class SimulationConfig:
    """What to simulate.

    Attributes:
        tracks: how many objects.
        scans: usable scans a track; None: 24 for a LiDAR, 5 for the depth camera.
        vary_scans: draw each track's number of scans from half to 5/3 of `scans` (12-40 of 24).
        sensor: what scans.
        category: of our procedural shapes, by default cars; airplanes and chairs are for the depth
            camera. Of meshes none is known unless it is given.
        meshes: folder of the user's meshes instead (x forward, z up, metres); track i shows the
            mesh i of the sorted list, again from the first after the last.
        occlusion: probability that something stands in the way in a LiDAR track; None: 0.3.
        ground: leave ground returns within 0.3 m of the object in (LiDAR).
        dropout: share of pulses or pixels lost at random; None: 0.05 LiDAR, 0 camera.
        noise_m: sigma of the range noise, metres; None: the sensor's own (camera: 0).
        shape_points: points of the complete truth shape.
        min_points: a scan with fewer points on the object is not usable (METHOD 2).
        near_m: smallest range of the object from a LiDAR, metres.
        far_m: largest range, metres; less where too few scans of an object are usable.
        whole_pass: share of the LiDAR tracks that are spread over as much of a pass as there is,
            every k-th scan; the others are every scan of a short stretch, as a sensor that loses
            its object early leaves it.
        rays: that passed the object by, kept with each scan at most (LiDAR).
        varied: for training: vehicles of more sizes and forms, sensors that differ from track to
            track, and scans cut off above the ground, as crops of real ones are (LiDAR).
    """

    tracks: int = 100
    scans: int | None = None
    vary_scans: bool = False
    sensor: SensorName = "hdl64"
    category: Category | None = None
    meshes: Path | None = None
    occlusion: float | None = None
    ground: bool = False
    dropout: float | None = None
    noise_m: float | None = None
    shape_points: int = 8192
    min_points: int = 100
    near_m: float = 4.0
    far_m: float = 30.0
    whole_pass: float = 2 / 3
    rays: int = 0
    varied: bool = False

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated.

        Raises:
            BadInputError: a count, probability, sensor or category is out of range, or something is
                asked of a camera that LiDARs alone have.
        """
        if self.sensor not in SENSORS:
            raise BadInputError(f"sensor is {self.sensor!r}, expected one of {', '.join(SENSORS)}.")
        if self.category not in (None, "car", "airplane", "chair"):
            raise BadInputError(f"category is {self.category!r}, expected car, airplane or chair.")
        self._check_numbers()
        if self.is_lidar and self.shown != "car" and self.meshes is None:
            raise BadInputError(
                f"category {self.category} with sensor {self.sensor}: our {self.category}s are of "
                "unit size, expected a car; use --sensor depth-camera."
            )
        for name in ("occlusion", "ground", "rays", "varied"):
            if getattr(self, name) and not self.is_lidar:
                raise BadInputError(f"{name} is of LiDARs, sensor is {self.sensor}; leave it out.")

    def _check_numbers(self) -> None:
        check_fields(self)
        counts = {"tracks": self.tracks, "shape_points": self.shape_points, "scans": self.scans}
        for name, count in counts.items():
            if count is not None and count < 1:
                raise BadInputError(f"{name} is {count}, expected at least 1.")
        for name, share in {"occlusion": self.occluded, "dropout": self.loss}.items():
            if not 0 <= share < 1:
                raise BadInputError(f"{name} is {share}, expected 0 to below 1.")
        if not self.noise >= 0:
            raise BadInputError(f"noise_m is {self.noise}, expected 0 or more metres.")

    @property
    def is_lidar(self) -> bool:
        """Whether the sensor is a spinning LiDAR."""
        return isinstance(SENSORS[self.sensor], SpinningLidar)

    @property
    def device(self) -> SpinningLidar | DepthCamera:
        """The sensor itself."""
        return SENSORS[self.sensor]

    @property
    def shown(self) -> Category:
        """What our procedural shapes are."""
        return "car" if self.category is None else self.category

    @property
    def occluded(self) -> float:
        """Probability that something stands in the way."""
        return 0.3 if self.occlusion is None else self.occlusion

    @property
    def usual_scans(self) -> int:
        """Scans a track where nothing else is asked for."""
        return (24 if self.is_lidar else 5) if self.scans is None else self.scans

    @property
    def loss(self) -> float:
        """Share of pulses or pixels lost at random."""
        return (0.05 if self.is_lidar else 0.0) if self.dropout is None else self.dropout

    @property
    def noise(self) -> float:
        """Sigma of the range noise, metres."""
        return self.device.noise_m if self.noise_m is None else self.noise_m
