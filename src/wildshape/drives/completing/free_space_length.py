# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What rays say of how long a vehicle is: where they pass through, nothing stands.

A network ends a vehicle where most end that look like it. Where a scan shows a long side of a
vehicle and what is beyond its corner, an end of the box that lies further out is drawn inwards.
Widths stay: mirrors are wider than what is behind them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.completing.level_frame import Completed, as_box_sees
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import CarveConfig
from wildshape.records import Points

Box = Float[np.ndarray, "4"]
Size = tuple[float, float, float]
_SIGNS = (1, -1)  # of x at the front and at the rear


@dataclass
class _Slabs:
    """What was counted in slabs of a box, from its front and from its rear inwards.

    Attributes:
        passed: `(2, bins)` rays that go through beside a side that the sensor sees.
        own: `(2, bins)` points, all over the box.
        faced: `(2,)` scans whose sensor sees the end itself.
        points: of all scans in the box.
    """

    passed: Float[np.ndarray, "2 bins"]
    own: Float[np.ndarray, "2 bins"]
    faced: Float[np.ndarray, "2"]
    points: int = 0

    def add(self, other: "_Slabs") -> None:
        """What another scan says."""
        for mine, its in ((self.passed, other.passed), (self.own, other.own)):
            mine += its
        self.faced += other.faced
        self.points += other.points

    @classmethod
    def empty(cls, config: CarveConfig) -> "_Slabs":
        bins = round(config.reach_m / config.slab_m)
        return cls(np.zeros((2, bins)), np.zeros((2, bins)), np.zeros(2))


class Carving:
    """What the rays of whole scans say of the lengths of vehicles."""

    def __init__(self, vehicles: Sequence[Completed], turns: Turns, config: CarveConfig) -> None:
        """`turns`: of the drive's sensor."""
        self.vehicles, self.turns, self.config = vehicles, turns, config
        self._slabs = [_Slabs.empty(config) for _ in vehicles]
        self._present: dict[int, list[tuple[int, Box]]] = {}
        for i, one in enumerate(vehicles):
            for frame, box in zip(one.frames, turns.shown(one.frames, one.boxes)):
                self._present.setdefault(frame, []).append((i, box))
        self.frames = frozenset(self._present)

    def counted(self, frame: int, scan: Points) -> dict[int, _Slabs]:
        """What the rays of a scan, level world, say of each vehicle's box."""
        found = {}
        sensor = self.turns.T_level_sensor[frame].translation.numpy()
        off = np.stack([scan[:, axis] - sensor[axis] for axis in (0, 1)])
        for i, box in self._present.get(frame, ()):
            size = self.vehicles[i].size
            chosen = _towards(off, box[:2] - sensor[:2], size)
            towards = scan.compress(chosen, axis=0).astype(np.float64)
            found[i] = _counted(towards, sensor, box, size, self.config)
        return found

    def add(self, counted: dict[int, _Slabs]) -> None:
        """Keep what one scan says."""
        for i, slabs in counted.items():
            self._slabs[i].add(slabs)

    def carved(self) -> list[Completed]:
        """The same vehicles in boxes no longer than rays leave room for."""
        return [_cut(one, slabs, self.config) for one, slabs in zip(self.vehicles, self._slabs)]


def _counted(
    scan: Points, sensor: Float[np.ndarray, "3"], box: Box, size: Size, config: CarveConfig
) -> _Slabs:
    """What the rays of one scan that go towards a box say of it; all in the level world."""
    slabs = _Slabs.empty(config)
    points = as_box_sees(scan, box)
    origin = as_box_sees(sensor[None], box)[0]
    floor = -size[2] / 2 + config.low_m
    inside = np.all(np.abs(points) < np.array(size) / 2, axis=1) & (points[:, 2] > floor)
    slabs.points += int(inside.sum())
    reached = _passing(points, origin, size, config)
    bins = slabs.own.shape[1]
    for end, sign in enumerate(_SIGNS):
        depth = (size[0] / 2 - sign * points[inside, 0]) / config.slab_m
        slabs.own[end] += np.bincount(depth[depth < bins].astype(int), minlength=bins)
        slabs.faced[end] += sign * origin[0] > size[0] / 2
        through = (size[0] / 2 - sign * reached) / config.slab_m
        middles = np.arange(bins) + 0.5
        within = (through.min(0) < middles[:, None]) & (middles[:, None] < through.max(0))
        slabs.passed[end] += within.sum(1)
    return slabs


def _towards(
    off: Float[np.ndarray, "2 n"], ahead: Float[np.ndarray, "2"], size: Size
) -> Bool[np.ndarray, "n"]:
    """Which rays go where a box is, and reach it; both seen from above and from the sensor."""
    away, radius = float(np.hypot(*ahead)), float(np.hypot(*size[:2])) / 2
    along = ahead[0] * off[0] + ahead[1] * off[1]
    across = np.abs(ahead[0] * off[1] - ahead[1] * off[0])
    return (along > away * (away - radius)) & (across * max(away, radius) < along * radius)


def _passing(
    points: Float[np.ndarray, "n 3"],
    origin: Float[np.ndarray, "3"],
    size: Size,
    config: CarveConfig,
) -> Float[np.ndarray, "2 p"]:
    """Where rays come into the strip behind the long side that is seen, and leave it: their x.

    Without those that end before they leave; none where the sensor sees no long side.
    """
    if abs(origin[1]) < size[1] / 2:
        return np.empty((2, 0))
    facing, floor = np.sign(origin[1]), -size[2] / 2
    strip = sorted(facing * (size[1] / 2 - depth) for depth in config.strip_m)
    rays = points - origin
    first = np.zeros(len(rays))
    last = 1.0 - config.behind_m / np.linalg.norm(rays, axis=1)
    for axis, (low, high) in ((1, strip), (2, (floor + config.low_m, floor + config.high_m))):
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(wall - origin[axis]) / rays[:, axis] for wall in (low, high)])
        first, last = np.maximum(first, ends.min(0)), np.minimum(last, ends.max(0))
    kept = first < last
    return origin[0] + np.stack((first, last))[:, kept] * rays[kept, 0]


def _cut(one: Completed, slabs: _Slabs, config: CarveConfig) -> Completed:
    """A box whose ends are drawn inwards as far as rays went through and no own points are."""
    inwards = []
    for end in range(len(_SIGNS)):
        free = _until(slabs.passed[end] >= config.fewest_rays)
        bare = _until(np.cumsum(slabs.own[end]) <= config.strays * slabs.points + 1)
        corner = config.corner_m if slabs.faced[end] else config.far_corner_m
        room = min(free * config.slab_m - corner, bare * config.slab_m)
        inwards.append(min(max(room, 0.0), config.most_m))
    front, rear = inwards
    boxes = one.boxes.copy()
    along = np.stack((np.cos(boxes[:, 3]), np.sin(boxes[:, 3])), axis=1)
    ahead = (rear - front) / 2
    boxes[:, :2] += ahead * along
    length, width, height = one.size
    size = (length - front - rear, width, height)
    return replace(one, boxes=boxes, size=size, moved_m=(ahead, 0.0, 0.0))


def _until(flags: Bool[np.ndarray, "bins"]) -> int:
    """How many come before the first that is not so."""
    return int(np.argmin(np.append(flags, False)))
