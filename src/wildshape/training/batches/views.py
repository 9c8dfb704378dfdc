# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""V scans of each of I tracks, as one batch (METHOD 2 and 6). The trainer's only reader."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import Facing, face, face_each, roll
from wildshape.geometry.transforms.rotation import random_rotation, random_yaw
from wildshape.io.store.store import Store
from wildshape.records import SensorKind

Turn = Literal["none", "yaw", "so3", "facing"]


@dataclass(frozen=True)
class ViewConfig:
    """How a batch is drawn; the defaults are the paper's for LiDAR.

    Attributes:
        tracks: I, tracks a batch.
        views: V, scans of each.
        points: n, each scan resampled with replacement to this many.
        window: the V scans lie within this many consecutive frames of the track.
        turn: each scan turned about the sensor by its own random rotation before training:
            `none` (the paper), `yaw` or `so3`; or `facing`: turned towards its object and, as a
            share `roll` of them, rolled about the line of sight (`line_of_sight.py`).
        roll: share of the scans rolled at random under `facing`; the others hardly roll.
        roll_rad: standard deviation of the roll of those others; sensors are not quite level.
        sensor: decides the centring, `lidar` the frustum's middle, `camera` the box's, and which
            way is up where scans are turned towards their object.
        min_points: scans with fewer are never drawn.
    """

    tracks: int = 8
    views: int = 4
    points: int = 1024
    window: int = 20
    turn: Turn = "none"
    roll: float = 0.0
    roll_rad: float = 0.1
    sensor: SensorKind = "lidar"
    min_points: int = 100


class Batch(NamedTuple):
    """Centred scans, the views of a track next to each other.

    Attributes:
        scans: B = I x V clouds of n points, metres, about their own centres.
        centres: label-free centres of the whole scans, found in the (turned) sensor frames.
        reference: row of the reference scan of each track.
        turn: rotation by which each scan was turned about its sensor.
        anchor: `R_sensor_canonical` that each scan, as recorded, is held to; zero until headings
            are agreed on.
    """

    scans: Float[Tensor, "B N 3"]
    centres: Float[Tensor, "B 3"]
    reference: Tensor
    turn: Float[Tensor, "B 3 3"]
    anchor: Float[Tensor, "B 3 3"]

    def to(self, device: torch.device | str) -> "Batch":
        """The same batch on a device."""
        return Batch(*(part.to(device, non_blocking=True) for part in self))


class ViewSampler:
    """Draws batches from a store; a batch depends on its seeds alone, not on those before it."""

    def __init__(self, store: Store, tracks: np.ndarray, config: ViewConfig) -> None:
        """Sample from the given track indices of the store.

        Raises:
            BadInputError: no track has a scan with enough points.
        """
        self.store, self.config = store, config
        starts, sizes = store.track_starts, store.scan_sizes
        usable = [
            starts[t] + np.flatnonzero(sizes[starts[t] : starts[t + 1]] >= config.min_points)
            for t in tracks
        ]
        self.scans_of = [scans for scans in usable if len(scans) > 0]
        if not self.scans_of:
            raise BadInputError(
                f"{store.named}: no track has a scan of {config.min_points} points or more;"
                " nothing to train on."
            )
        self.anchors: Float[Tensor, "S 3 3"] | None = None
        facing = config.turn == "facing"
        self._frames = np.full((len(sizes) if facing else 0, 4, 3), np.nan, dtype=np.float32)
        self._faced = np.zeros(len(self._frames), dtype=bool)
        self._centres = np.full((len(sizes), 3), np.nan, dtype=np.float32)

    def draw(self, *seed: int) -> Batch:
        """The batch of these seeds, for example (run seed, step, process)."""
        rng = np.random.default_rng(seed)
        config = self.config
        chosen = rng.integers(len(self.scans_of), size=config.tracks)
        rows = np.concatenate([self._window(self.scans_of[t], rng) for t in chosen])
        first = np.arange(config.tracks) * config.views
        reference = torch.from_numpy(first + rng.integers(config.views, size=config.tracks))
        scans, centres, rotation = self.turned(rows, rng)
        anchor = torch.zeros_like(rotation)
        if self.anchors is not None:
            anchor = self.anchors[torch.from_numpy(rows)]
        return Batch(scans, centres, reference, rotation, anchor)

    def turned(
        self, rows: np.ndarray, rng: np.random.Generator
    ) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B 3"], Float[Tensor, "B 3 3"]]:
        """Scans of the store, turned as configured, centred and resampled; centres; turns."""
        config = self.config
        if config.turn == "facing":
            scans, centres, turn = self.gather_as_posed([int(s) for s in rows], rng)
            rolled = _rolls(len(rows), config, rng)
            return scans @ rolled.mT, centres, rolled @ turn
        scans, centres = self.gather([int(s) for s in rows], rng)
        rotation = _turns(len(rows), config.turn, int(rng.integers(2**62)))
        scans, turned = scans @ rotation.mT, (rotation @ centres[..., None])[..., 0]
        if not centre_turns_along(config):
            middle = torch.stack([self._turned_centre(int(s), R) for s, R in zip(rows, rotation)])
            scans, turned = scans + (turned - middle)[:, None], middle
        return scans, turned, rotation

    def turned_points(
        self, points: Float[Tensor, "B n 3"], rng: np.random.Generator
    ) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B 3"], Float[Tensor, "B 3 3"]]:
        """As `turned`, of scans `(B, n, 3)` that are not the store's; sensor frames."""
        config = self.config
        if config.turn == "facing":
            frames = frames_of(points, config)
            turn, centres = _rolls(len(points), config, rng) @ frames.turn, frames.centre
        else:
            turn = _turns(len(points), config.turn, int(rng.integers(2**62)))
            turned = points @ turn.mT
            centres = scan_centre(turned, config.sensor)
        return points @ turn.mT - centres[:, None], centres, turn

    def as_posed(
        self, points: Float[Tensor, "B n 3"]
    ) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B 3"], Float[Tensor, "B 3 3"]]:
        """Scans that are not the store's, centred and turned as `gather_as_posed` does."""
        turn, centres = frames_of(points, self.config)
        return points @ turn.mT - centres[:, None], centres, turn

    def gather_as_posed(
        self, scans: list[int], rng: np.random.Generator
    ) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B 3"], Float[Tensor, "B 3 3"]]:
        """As `gather`, but turned as a scan to be posed is: towards its object, or not at all."""
        if self.config.turn != "facing":
            return *self.gather(scans, rng), torch.eye(3).repeat(len(scans), 1, 1)
        turn, centres = self._facing(scans)
        clouds = torch.stack([self.picked(scan, rng) for scan in scans])
        return clouds @ turn.mT - centres[:, None], centres, turn

    def gather(
        self, scans: list[int], rng: np.random.Generator
    ) -> tuple[Float[Tensor, "B n 3"], Float[Tensor, "B 3"]]:
        """Scans of the store, centred and resampled, and their centres."""
        clouds = torch.stack([self.picked(scan, rng) - self._centre(scan) for scan in scans])
        return clouds, torch.stack([self._centre(scan) for scan in scans])

    def extent_range(self, scans: int = 500) -> tuple[float, float]:
        """Smallest and largest bounding-box diagonal, metres, over a seeded sample of scans."""
        rng = np.random.default_rng(0)
        rows = rng.choice(np.concatenate(self.scans_of), size=scans)
        clouds = (self.store.scan_points(int(row)) for row in rows)
        extents = [float(np.linalg.norm(np.ptp(cloud, axis=0))) for cloud in clouds]
        return min(extents), max(extents)

    def _window(self, scans: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """V scans within `window` frames of each other, distinct where there are enough."""
        config = self.config
        # In frames, not in usable scans: those too sparse to be used leave gaps.
        last = np.searchsorted(scans, scans[-1] - config.window, side="right")
        near = scans[rng.integers(last + 1) :]
        near = near[near < near[0] + config.window]
        return rng.choice(near, size=config.views, replace=len(near) < config.views)

    def picked(self, scan: int, rng: np.random.Generator) -> Float[Tensor, "n 3"]:
        """A scan of the store resampled with replacement, sensor frame, metres."""
        points = self.store.scan_points(scan)
        chosen = rng.integers(len(points), size=self.config.points)
        return torch.from_numpy(points.take(chosen, axis=0))  # 8 times as fast as points[chosen]

    def _facing(self, scans: list[int]) -> Facing:
        """The facing frames of scans, each found once."""
        new = [scan for scan in dict.fromkeys(scans) if not self._faced[scan]]
        if new:
            found = face_each([self._points(scan) for scan in new], self.config.sensor)
            self._frames[new, :3], self._frames[new, 3] = found.turn.numpy(), found.centre.numpy()
            self._faced[new] = True  # last: another thread may draw
        known = torch.from_numpy(self._frames[scans])
        return Facing(known[:, :3], known[:, 3])

    def _centre(self, scan: int) -> Tensor:
        """The label-free centre of a scan, found once."""
        centre = self._centres[scan]
        if np.isnan(centre).any():
            centre[:] = scan_centre(self._points(scan), self.config.sensor).numpy()
        return torch.from_numpy(centre)

    def _turned_centre(self, scan: int, rotation: Float[Tensor, "3 3"]) -> Float[Tensor, "3"]:
        """The centre of the whole scan as it is seen when turned."""
        return scan_centre(self._points(scan) @ rotation.mT, self.config.sensor)

    def _points(self, scan: int) -> Float[Tensor, "n 3"]:
        return torch.from_numpy(np.ascontiguousarray(self.store.scan_points(scan)))


def frames_of(
    points: Float[Tensor, "B n 3"], config: ViewConfig, counted: Tensor | None = None
) -> Facing:
    """Turn and centre of scans that are to be posed: towards their objects, or as they are."""
    if config.turn == "facing":
        return face(points, counted, sensor_kind=config.sensor)
    as_recorded = torch.eye(3, device=points.device).repeat(len(points), 1, 1)
    return Facing(as_recorded, scan_centre(points, config.sensor))


def centre_turns_along(config: ViewConfig) -> bool:
    """Whether the centre of a turned scan is its centre, turned.

    A frustum about the vertical axis turns along in yaw, and a centre on the line of sight rolls
    into itself; a box and any other turn need the centre to be found again, as it will be of any
    scan posed later.
    """
    in_yaw = config.turn == "yaw" and config.sensor == "lidar"
    return config.turn in ("none", "facing") or in_yaw


def _rolls(count: int, config: ViewConfig, rng: np.random.Generator) -> Float[Tensor, "B 3 3"]:
    """Turns about the line of sight: any for a share of the scans, a few degrees for the others."""
    free = rng.random(count) < config.roll
    any_roll, little = rng.uniform(-np.pi, np.pi, count), rng.normal(0.0, config.roll_rad, count)
    angle = np.where(free, any_roll, little)
    return roll(torch.from_numpy(angle.astype(np.float32)))


def _turns(count: int, turn: str, seed: int) -> Float[Tensor, "B 3 3"]:
    """A random rotation for each scan, of the kind asked for."""
    generator = torch.Generator().manual_seed(seed)
    if turn == "none":
        return torch.eye(3).repeat(count, 1, 1)
    return random_yaw(count, generator) if turn == "yaw" else random_rotation(count, generator)
