# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""From scan to scan by KISS-ICP (Vizzo et al., RA-L 2023); what is done where one does not fit.

KISS-ICP lays points on points. A sensor's lines on walls rise or fall as it comes nearer, which
turns its pitch a little in each scan. The ground holds it level.
"""

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from jaxtyping import Float

from wildshape.drives.config import TrajectoryConfig
from wildshape.drives.tracking.ground_map import GroundMap
from wildshape.errors import load_library
from wildshape.geometry.transforms.se3 import SE3
from wildshape.geometry.transforms.twist import Twist
from wildshape.ops.nearest import nearest
from wildshape.records import Points, Turn

if TYPE_CHECKING:
    from kiss_icp.kiss_icp import KissICP

FEWEST_POINTS = 100  # of a scan that is followed
_INSTALL = "pip install kiss-icp, or give a poses.txt beside the scans"
_STEPS_M = (2.0, 4.0, 6.0, 8.0)  # from 2 m off a scan finds its place
_STEPS_DEG = range(0, 360, 45)  # of the sensor's x


class Odometry:
    """KISS-ICP, begun anew where a scan does not fit the one before.

    Attributes:
        motion: of the sensor, after the last scan.
        up: the vertical in the sensor frame, unit length.
        ground: that holds it level.
        lost: frames that did not fit.
        timed: how many scans had times of their points.
        untimed: the other frames.
    """

    def __init__(self, config: TrajectoryConfig, motion: Twist, up: Float[np.ndarray, "3"]) -> None:
        self.config, self.motion, self.up = config, motion, up
        self.ground = GroundMap(config, up)
        self.kiss = _kiss_icp(config, self.ground)
        self.lost: list[int] = []
        self.timed, self.untimed = 0, list[int]()
        self._before: Float[np.ndarray, "n 3"] | None = None
        self._scan_before: Points = np.empty((0, 3), np.float32)

    def count(self, turn: Turn, frame: int) -> None:
        """Whether its points have times."""
        if turn.seconds is None:
            self.untimed.append(frame)
        else:
            self.timed += 1

    def expect(self, seconds: float) -> None:
        """Guess the next step from the motion."""
        self.kiss.last_delta = self.motion.after(seconds).matrix.numpy()

    def learn(self, seconds: float) -> None:
        """Take the motion from the last step."""
        step = SE3.from_matrix(self.kiss.last_delta)
        self.motion = Twist.between(SE3.identity(), step, seconds)

    def follow(self, scan: Points, ground: Points, frame: int) -> None:
        """Go one scan on; `scan`: what stands on the ground."""
        pose, step = self.kiss.last_pose, self.kiss.last_delta
        self.ground.see(ground)
        there = _registered(self.kiss, scan)
        fit = 1.0 if self._before is None else self._fit(there)
        if fit < self.config.good_fit and (found := self._from_afar(scan, pose)) is not None:
            self.kiss, there = found
            _hold(self.kiss, self.ground)
        elif fit < self.config.least_fit and self._fit(there, back=True) < self.config.least_fit:
            self.lost.append(frame)
            self.ground = GroundMap(self.config, self.up)
            self.ground.see(ground)
            self.kiss = _kiss_icp(self.config, self.ground)
            self.kiss.last_pose, self.kiss.last_delta = pose, step
            there = _registered(self.kiss, scan)
        self.ground.add(self.kiss.last_pose)
        self._before, self._scan_before = there, scan

    def _from_afar(
        self, scan: Points, pose: Float[np.ndarray, "4 4"]
    ) -> "tuple[KissICP, Float[np.ndarray, 'n 3']] | None":
        """Where a scan fits best after a long step from the one before, if it fits well."""
        found = []
        for far, turn in product(_STEPS_M, np.deg2rad(_STEPS_DEG)):
            kiss = _kiss_icp(self.config)
            kiss.last_pose = pose
            _registered(kiss, self._scan_before)
            kiss.last_delta[:2, 3] = far * np.cos(turn), far * np.sin(turn)
            found.append((kiss, _registered(kiss, scan)))
        best = max(found, key=lambda one: self._fit(one[1]))
        return best if self._fit(best[1]) >= self.config.good_fit else None

    def _fit(self, there: Float[np.ndarray, "n 3"], *, back: bool = False) -> float:
        """The share of a scan that lies on the one before.

        `back`: of the one before that lies on it; on half a scan no more than half of it lies.
        """
        both = [torch.from_numpy(points).float()[None] for points in (there, self._before)]
        away = nearest(*(both[::-1] if back else both)).distance_squared
        return float((away < self.config.fits_m**2).float().mean())


class _Levelled:
    """KISS-ICP's registration; then the ground lifts and tilts the pose, with which both go on."""

    def __init__(self, registration: Any, ground: GroundMap) -> None:
        self._registration, self._ground = registration, ground

    def align_points_to_map(self, **known: Any) -> Float[np.ndarray, "4 4"]:
        """As KISS-ICP calls it."""
        return self._ground.levelled(self._registration.align_points_to_map(**known))


def _registered(kiss: "KissICP", scan: Points) -> Float[np.ndarray, "n 3"]:
    """Go one scan on; some of its points, in the world."""
    _, some = kiss.register_frame(scan.astype(np.float64), np.zeros(len(scan)))
    T = kiss.last_pose
    return some @ T[:3, :3].T + T[:3, 3]


def _kiss_icp(config: TrajectoryConfig, ground: GroundMap | None = None) -> "KissICP":
    load_library("kiss_icp.kiss_icp", "the sensor's way is found by KISS-ICP", _INSTALL)
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    settings = load_config(None)
    settings.registration.max_num_threads = 1  # the same scans give the same way to the last bit
    settings.data.deskew = False  # done before, as for all other stages
    settings.data.min_range, settings.data.max_range = config.nearest_m, config.range_m
    settings.registration.convergence_criterion = config.settled
    settings.mapping.voxel_size = config.voxel_m
    kiss = KissICP(settings)
    if ground is not None:
        _hold(kiss, ground)
    return kiss


def _hold(kiss: "KissICP", ground: GroundMap) -> None:
    """Its poses are levelled from now on."""
    level = _Levelled(kiss.registration, ground)
    kiss.registration = level  # pyright: ignore[reportAttributeAccessIssue]
