# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How a sensor is mounted: its height and tilt, from the ground around it.

Planes through three points are tried (RANSAC: Fischler and Bolles 1981). The ground is the one with
the most points on it and hardly any below; of many scans the middle one is believed, for roads
slope.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
import torch
from jaxtyping import Float

from wildshape.drives.config import MountingConfig
from wildshape.drives.source import Drive
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.rotation import smallest_turn
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Points

_MOST_POINTS, _FEWEST_POINTS = 4000, 100
_OFF_UNIT = 1e-3
_LOWEST_M = 0.15  # no sensor that sees vehicles sits lower
_HIGHEST_M = 4.5  # nor higher, on a vehicle
_LEAST_GROUND = 0.05  # of the points near the sensor; less is what a removal of ground leaves
_SPREAD_M = 0.2  # no more differ the heights found, on streets 0.03; without ground 0.07 and more
_EDGE_SCANS, _EDGE_M, _EDGE_POINTS = 3, 5e-3, 20
_EDGE_ALIKE = 10.0  # scans cut off at a height end up to 4 points' distances apart, others 22
_EDGE_BELOW_M = 0.2  # what is cut off so far below the ground is none of it
_EVEN_M = 0.02  # an even floor's noise ends so near below it
_HARDER, _HANGING = 10, 0.1  # no more of scans upside down lies on what looks like ground
_SOON = (5, 10, 20)  # frames that are looked at beside those of the config
_BELOW_M, _BELOW_POINTS, _BELOW_SCANS = 1.0, 10, 2  # ground seen right below the sensor
_DIRECTIONS = 720  # of Ouster's fewest columns, 512, two neighbours never hold none
_MOST_GAPS = 8  # what stands on the vehicle leaves fewer, and so do sensors beside each other
_UPSIDE_DOWN = np.array((1.0, -1.0, -1.0), np.float32)

Plane = Float[np.ndarray, "4"]


@dataclass(frozen=True)
class Mounting:
    """Where the sensor sits.

    Attributes:
        height_m: above the ground.
        tilt_deg: between its z axis and the vertical.
        up: `(3,)` the vertical in the sensor frame, unit length; (0, 0, 1) for one held level.
        ground: share of the points near the sensor that lie on the ground.
        common: whether scans seem to be in one frame, that of the first.
        spread_m: of the heights found in single scans, from the lower to the upper quartile.
        cut_m: so far below the sensor scans seem to be cut off, at the ground or above it; 0: not.
        gaps: around the sensor, of the middle scan, in which not even ground is seen.
    """

    height_m: float
    tilt_deg: float
    up: tuple[float, float, float]
    ground: float = 1.0
    common: bool = False
    spread_m: float = 0.0
    cut_m: float = 0.0
    gaps: int = 0

    def __post_init__(self) -> None:
        """Refuse what is no vertical.

        Raises:
            ValueError: `up` is no unit vector, or points down.
        """
        if abs(math.hypot(*self.up) - 1) > _OFF_UNIT or not self.up[2] > 0:
            raise ValueError(f"the vertical is {self.up}")

    @property
    def is_tilted(self) -> bool:
        """Whether the sensor's z is not taken for vertical."""
        return self.up != (0.0, 0.0, 1.0)

    def told(self) -> list[str]:
        """A sentence on each thing that is odd about it."""
        told = []
        if self.height_m <= _LOWEST_M:
            told.append(
                f"the ground lies {self.height_m:z.2f} m below the origin: give scans as the sensor"
                " saw them, not in a vehicle's or a map's frame"
            )
        if self.height_m > _HIGHEST_M:
            told.append(
                f"the ground lies {self.height_m:.1f} m below the sensor, higher than on any"
                " vehicle: if it is on no mast, the scans may not be in metres"
            )
        if self.ground < _LEAST_GROUND:
            told.append(
                f"hardly any ground is seen, {100 * self.ground:.0f} % of the points near the"
                " sensor: give scans with their ground"
            )
        elif self.cut_m:
            told.append(
                f"no scan shows anything lower than {self.cut_m:.2f} m below the sensor, as if its"
                " ground were cut off: boxes may be too high; give scans with their ground"
            )
        elif self.spread_m > _SPREAD_M:
            told.append(
                f"the ground's height differs by {self.spread_m:.1f} m from scan to scan, as if"
                " most of it were taken away: give scans with their ground"
            )
        elif self.gaps > _MOST_GAPS:
            told.append(
                f"scans have {self.gaps} gaps around the sensor in which nothing is seen, as if"
                " packets were lost: vehicles there are lost or cut apart; give whole scans"
            )
        if self.common:
            told.append(
                "later scans show ground right below the sensor, the first none, as if all were in"
                " one common frame or put together of several: give each as the sensor saw it"
            )
        return told

    def levelling(self) -> SE3:
        """`T_level_sensor`: the smallest turn after which z is vertical; the origin stays."""
        turn = torch.from_numpy(smallest_turn(np.array(self.up), np.array((0.0, 0.0, 1.0))))
        return SE3(turn, torch.zeros(3, dtype=torch.float64))

    def level(self, scan: Points) -> Points:
        """A scan with z vertical."""
        return self.levelling().apply_numpy(scan) if self.is_tilted else scan


@np.errstate(over="ignore", invalid="ignore")  # of what is no scan; a sentence says so
def find_mounting(drive: Drive, config: MountingConfig) -> Mounting:
    """Height and tilt of a drive's sensor.

    Raises:
        BadInputError: no scan shows ground around the sensor, or it is above.
    """
    chosen = np.unique(np.linspace(0, len(drive) - 1, config.scans).round().astype(int)).tolist()
    scans = _with_points(drive, chosen, config) or _with_points(drive, range(len(drive)), config)
    if not scans:
        drive.read(0)  # says why if it cannot be read
        raise BadInputError(
            f"{drive.told}: its scans hold no points, or all of them are NaN; write them again."
        )
    if all(_is_an_object(scan, config) for scan in scans):
        raise BadInputError(
            f"{drive.told}: its scans are of single objects, cut out; drive needs the whole scans."
            " For objects there is `wildshape complete --track`."
        )
    planes = [ground_plane(scan, config) for scan in scans]
    share = _on_ground(scans, planes, config)
    if share <= config.ground and _hangs(scans, share, config):
        harder = replace(config, trials=_HARDER * config.trials)  # a floor under a ceiling is small
        planes = [ground_plane(scan, harder) for scan in scans]
        share = _on_ground(scans, planes, config)
        if share <= _HANGING:
            raise BadInputError(
                f"{drive.told}: the ground lies above the sensor, as if it hung upside down; turn"
                " the scans by 180 degrees about x, so that z points up."
            )
    found = np.array([plane for plane in planes if plane is not None])
    if not len(found):
        raise BadInputError(
            f"{drive.told}: no ground is seen below the sensor; the scans must be full ones in the"
            " sensor's frame, metres, z up."
        )
    height = float(np.median(found[:, 3]))
    up = np.median(found[:, :3], axis=0)
    up /= np.linalg.norm(up)
    tilt = math.degrees(math.acos(min(1.0, float(up[2]))))
    if tilt < config.level_deg:
        up = np.array((0.0, 0.0, 1.0))
    x, y, z = up.tolist()
    return Mounting(
        height,
        tilt,
        (x, y, z),
        share,
        _in_common(drive, chosen, config),
        float(np.subtract(*np.percentile(found[:, 3], (75, 25)))),
        _cut_off(scans, height, config),
        int(np.median([_gaps(scan) for scan in scans])),
    )


def _with_points(drive: Drive, frames: Iterable[int], config: MountingConfig) -> list[Points]:
    """The scans of some frames that hold points, so many at most."""
    return list(islice(filter(len, map(drive.scan, frames)), config.scans))


def _gaps(scan: Points) -> int:
    """In how many places around the sensor neighbouring directions hold no point."""
    around = np.arctan2(scan[:, 1], scan[:, 0]) / (2 * np.pi) % 1.0
    rows = (around * _DIRECTIONS).astype(int) % _DIRECTIONS
    empty = np.bincount(rows, minlength=_DIRECTIONS) == 0
    return int((empty & np.roll(empty, -1) & ~np.roll(empty, 1)).sum())


def _cut_off(scans: list[Points], height_m: float, config: MountingConfig) -> float:
    """How far below the sensor all scans end alike, at the ground found or above it; else 0."""
    every = [near[:, 2] for near in (_near(scan, config) for scan in scans) if len(near)]
    lowest = [float(z.min()) for z in every]
    at_edge = float(np.median([(z < low + _EDGE_M).sum() for z, low in zip(every, lowest)]))
    if len(every) < _EDGE_SCANS or at_edge < _EDGE_POINTS:
        return 0.0
    below_m = -min(lowest)
    alike = max(lowest) - min(lowest) < _EDGE_ALIKE * _EDGE_M / at_edge
    lower_m = below_m - height_m
    return below_m if alike and lower_m < _EDGE_BELOW_M and abs(lower_m) > _EVEN_M else 0.0


def _near(points: Points, config: MountingConfig) -> Points:
    """Those around the sensor."""
    return points[(points[:, :2] ** 2).sum(1) < config.reach_m**2]


def _in_common(drive: Drive, chosen: list[int], config: MountingConfig) -> bool:
    """Whether ground is seen where the sensor's own vehicle is, but not from the first scan on."""
    soon = [frame for frame in _SOON if frame < len(drive)]
    first, *later = sorted({*chosen, *soon})
    if not len(drive.scan(first)) or _seen_below(drive.scan(first), config):
        return False
    seen = [_seen_below(drive.scan(frame), config) for frame in later]
    return sum(points > _BELOW_POINTS for points in seen) >= _BELOW_SCANS


def _seen_below(scan: Points, config: MountingConfig) -> int:
    """How many points of the ground lie right below the sensor."""
    near = scan[(scan[:, :2] ** 2).sum(1) < _BELOW_M**2]
    plane = ground_plane(scan, config) if len(near) else None
    if plane is None:
        return 0
    return int((np.abs(near @ plane[:3] + plane[3]) < config.thick_m).sum())


def _is_an_object(scan: Points, config: MountingConfig) -> bool:
    """Whether a scan is small and lies on one side of the sensor."""
    middle, sides = scan.mean(0), np.ptp(scan, axis=0)
    around = (scan[:, :2] @ middle[:2] < 0).any()
    return bool(max(sides[:2]) < config.object_m and not around)


def _hangs(scans: list[Points], share: float, config: MountingConfig) -> bool:
    """Whether most of the points lie where the sky is; `share`: on what looks like ground."""
    turned = [scan * _UPSIDE_DOWN for scan in scans]
    found = _on_ground(turned, [ground_plane(scan, config) for scan in turned], config)
    return found > max(config.ground, 2 * share)


def _on_ground(scans: list[Points], planes: list[Plane | None], config: MountingConfig) -> float:
    """The share of the points around the sensor that lie on the ground, of the middle scan."""
    shares = []
    for points, plane in zip(scans, planes):
        near = _near(points, config)
        away = near[:0] if plane is None else np.abs(near @ plane[:3] + plane[3])
        shares.append(float((away < config.thick_m).sum()) / max(len(near), 1))
    return float(np.median(shares))


def ground_plane(points: Points, config: MountingConfig) -> Plane | None:
    """Unit normal (upwards) of the ground around the sensor, and how far below it lies, metres.

    None where a scan shows no ground: hardly any points, or no plane that is level enough.
    """
    rng = np.random.default_rng(0)
    near = _near(points, config).astype(np.float64)
    near = near[rng.permutation(len(near))[:_MOST_POINTS]]
    if len(near) < _FEWEST_POINTS:
        return None
    corners = near[rng.integers(len(near), size=(config.trials, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.where(lengths > 0, lengths, 1.0)[:, None]
    normals *= np.where(normals[:, 2:] < 0, -1.0, 1.0)
    depths = -(normals * corners[:, 0]).sum(1)
    heights = near @ normals.T + depths  # of each point above each plane
    on = (np.abs(heights) < config.thick_m).sum(0)
    below = (heights < -config.thick_m).mean(0)
    upright = normals[:, 2] > math.cos(math.radians(config.steepest_deg))
    under = upright & (depths > 0)
    possible = under & (below < config.below)
    hardly = on[possible].max(initial=0) < _LEAST_GROUND * len(near)
    if hardly:  # what many reflections leave; then the ground is what most points lie on
        possible = under & (on > config.ground * len(near)) | possible
    if not possible.any():
        return None
    best = int(np.where(possible, on, -1).argmax())
    return _fitted(near[np.abs(heights[:, best]) < config.thick_m])


def _fitted(points: Float[np.ndarray, "n 3"]) -> Plane:
    """The plane of least squared distances."""
    middle = points.mean(0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    normal = normal if normal[2] > 0 else -normal
    return np.append(normal, -normal @ middle)
