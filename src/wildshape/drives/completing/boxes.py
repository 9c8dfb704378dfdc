# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The box of a vehicle in every frame in which it was seen, and in short gaps between them.

A vehicle that stands has one box in the world: the middle of those of its completed scans. One
that moves goes a smooth way through them: in each frame a parabola is fitted to the places around
it, the nearer the heavier (local regression, Cleveland 1979), for vehicles brake and set off.
Before and after them it goes straight on.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from wildshape.drives.completing.level_frame import Completed
from wildshape.drives.completing.rolling_shutter import Turns
from wildshape.drives.object_config import BoxConfig
from wildshape.drives.source import HALF_TICK

_ROUNDS = 10
_ENOUGH = 4  # moments for a parabola: through three one goes whatever they are
_BEFORE = 3  # completed scans that the next one has to agree with
_REACH = 3.0  # widths of the kernel, to the farthest scan that a curve needs


@dataclass(frozen=True)
class Way:
    """A vehicle's boxes in the drive's level world frame.

    Attributes:
        frames: in which it has a box, rising.
        boxes: `(f, 4)` centre x, y, z and yaw when the beam meets it in each, metres and radians.
        moving: or standing.
    """

    frames: Sequence[int]
    boxes: Float[np.ndarray, "f 4"]
    moving: bool

    @cached_property
    def bounds(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """Least and largest x and y."""
        return self.boxes[:, :2].min(0), self.boxes[:, :2].max(0)


def smooth(one: Completed, turns: Turns, config: BoxConfig) -> Way:
    """The way of one vehicle over the frames in which it was seen, and short gaps between."""
    seen = one.seen.frames
    frames = [seen[0]]
    for frame in seen[1:]:
        if turns.ticks[frame] - turns.ticks[frames[-1]] < config.longest_gap + HALF_TICK:
            frames.extend(range(frames[-1] + 1, frame))
        frames.append(frame)
    return way_over(one, tuple(frames), turns, config)


def way_over(one: Completed, frames: Sequence[int], turns: Turns, config: BoxConfig) -> Way:
    """The way of one vehicle over frames, seen or not; see `smooth`."""
    at = np.take(turns.ticks, one.frames) + one.phases
    if not moves(at, one.boxes, config):
        return Way(frames, np.tile(_middle(one.boxes), (len(frames), 1)), moving=False)
    kept = _believed(at, one.boxes[:, :2], config)
    at, completed = at[kept], one.boxes[kept]
    middles = np.take(turns.ticks, frames).astype(np.float64)
    boxes = _on_its_way(at, completed, middles, config)
    met = middles + turns.phases(frames, boxes)
    return Way(frames, _on_its_way(at, completed, met, config), moving=True)


def _believed(
    at: Float[np.ndarray, "k"], places: Float[np.ndarray, "k 2"], config: BoxConfig
) -> Bool[np.ndarray, "k"]:
    """Which completed scans lie near a smooth way of most around them: half seen, some slip.

    The way is a wider parabola, fitted anew with less weight on what lay far from it (Geman and
    McClure 1987).
    """
    off = np.zeros(len(at))
    if len(at) > _ENOUGH:
        for _ in range(_ROUNDS):
            trust = 1 / (1 + (off / config.stray_m) ** 2) ** 2
            way = _parabolas(at, places, at, config.stray_ticks, trust)
            off = np.linalg.norm(places - way, axis=1)
    return off <= config.stray_m


def _on_its_way(
    at: Float[np.ndarray, "k"],
    boxes: Float[np.ndarray, "k 4"],
    wanted: Float[np.ndarray, "f"],
    config: BoxConfig,
) -> Float[np.ndarray, "f 4"]:
    """Boxes of one that moves; `at`: the ticks of the completed ones, `wanted`: those asked for."""
    places, _ = _lines(at, boxes[:, :3], wanted, config.smooth_ticks)
    if len(_moments(at)) >= _ENOUGH:
        among = (wanted > at[0] - config.smooth_ticks) & (wanted < at[-1] + config.smooth_ticks)
        places[among] = _parabolas(at, boxes[:, :3], wanted[among], config.smooth_ticks)
    return np.column_stack((places, _yaws(at, boxes, wanted, config)))


def faced(one: Completed, turns: Turns, config: BoxConfig) -> Completed:
    """The same vehicle, its front where it drives to.

    No scan looks away from those before it. Then all are turned around if the vehicle would drive
    backwards for most of its way: it may stand, or back up for a while. Of one that is nowhere fast
    most scans decide.
    """
    at = np.take(turns.ticks, one.frames) + one.phases
    if not moves(at, one.boxes, config):
        return one
    boxes = one.boxes.copy()
    yaw = boxes[:, 3]
    for i in range(1, len(yaw)):  # some before it: a single one may look aside
        yaw[i] += np.pi * (np.cos(yaw[i] - yaw[max(i - _BEFORE, 0) : i]).sum() < 0)
    kept = _believed(at, boxes[:, :2], config)
    _, velocities = _lines(at[kept], boxes[kept, :3], at[kept], config.smooth_ticks)
    fast = np.linalg.norm(velocities[:, :2], axis=1) > config.heading_m_per_tick
    ahead = velocities[:, 0] * np.cos(yaw[kept]) + velocities[:, 1] * np.sin(yaw[kept])
    as_said = np.cos(yaw - one.boxes[:, 3]).sum()
    backwards = (ahead[fast].sum() if fast.any() else as_said) < 0
    yaw += np.pi * backwards
    return replace(one, boxes=boxes, turned=bool((as_said < 0) != backwards))


def expected(one: Completed, turns: Turns, beyond_ticks: int, config: BoxConfig) -> Way:
    """Where one may be: standing, in every frame; moving, a little beyond its track.

    Frames follow each other. None is beyond a break: where things stand there is guessed.
    """
    first, last = one.seen.frames[0], one.seen.frames[-1]
    frames, ticks = turns.unbroken(first, last), turns.ticks
    way = way_over(one, (first,), turns, config)
    if not way.moving:
        boxes = np.broadcast_to(way.boxes, (len(frames), 4))  # held once
        return Way(frames, boxes, moving=False)
    start = bisect_left(ticks, ticks[first] - beyond_ticks - HALF_TICK)
    stop = bisect_left(ticks, ticks[last] + beyond_ticks + HALF_TICK)
    frames = range(max(start, frames.start), min(stop, frames.stop))
    return way_over(one, frames, turns, config)


def moves(
    ticks: Float[np.ndarray, "k"], boxes: Float[np.ndarray, "k 4"], config: BoxConfig
) -> bool:
    """Whether a vehicle gets far enough, and fast enough, to be moving and not only uncertain.

    That is asked of its whole track, and of any few successive scans: it may have stood before and
    after. Its velocity is the middle one of those between any two scans (Theil 1950, Sen 1968): a
    few wrong poses do not move it. Most steps must be as fast, too: one that stands jumps once,
    where another end of it is seen. And only the way ahead or back counts: of a row of parked cars
    one that is half seen slips aside, to the next.
    """
    count = config.moving_scans
    few = (slice(first, first + count) for first in range(len(ticks) - count + 1))
    return any(_gets_far(ticks[some], boxes[some], config) for some in (slice(None), *few))


def velocity_of(
    ticks: Float[np.ndarray, "k"], places: Float[np.ndarray, "k 2"]
) -> Float[np.ndarray, "2"]:
    """The middle one of those between any two places; a single place does not move."""
    early, late = np.triu_indices(len(ticks), 1)
    if not len(early):
        return np.zeros(2)
    steps = (places[late] - places[early]) / _apart(ticks[late] - ticks[early])
    return np.median(steps, axis=0)


def _apart(ticks: Float[np.ndarray, "s"]) -> Float[np.ndarray, "s 1"]:
    """Ticks between scans: a beam may end a turn and begin the next one on the same vehicle."""
    return np.maximum(ticks, HALF_TICK)[:, None]


def _gets_far(
    ticks: Float[np.ndarray, "k"], boxes: Float[np.ndarray, "k 4"], config: BoxConfig
) -> bool:
    velocity = velocity_of(ticks, boxes[:, :2])
    speed = float(np.linalg.norm(velocity))
    if speed <= config.moving_m_per_tick:
        return False
    steps = np.diff(boxes[:, :2], axis=0) / _apart(np.diff(ticks)) @ (velocity / speed)
    most = float(np.quantile(steps, 0.5, method="lower"))
    off = boxes[:, 3] - np.arctan2(velocity[1], velocity[0])
    ahead_m = speed * float(np.ptp(ticks)) * float(np.median(np.abs(np.cos(off))))
    return most > config.moving_m_per_tick and ahead_m > config.moving_m


def _middle(boxes: Float[np.ndarray, "k 4"]) -> Float[np.ndarray, "4"]:
    """The middle place, and the mean direction without those that look another way than most."""
    yaw = boxes[:, 3]
    towards = np.cos(yaw[:, None] - yaw)
    leader = int(np.median(towards, axis=1).argmax())
    agree = towards[leader] > 0.5
    mean = np.arctan2(np.sin(yaw[agree]).mean(), np.cos(yaw[agree]).mean())
    return np.append(np.median(boxes[:, :3], axis=0), mean)


def _moments(at: Float[np.ndarray, "k"]) -> Float[np.ndarray, "m"]:
    """Ticks of the completed scans; two that lie no half tick apart are one moment."""
    return at[np.diff(at, prepend=-np.inf) >= HALF_TICK]


def _weights(
    at: Float[np.ndarray, "k"],
    wanted: Float[np.ndarray, "f"],
    smooth_ticks: float,
    needed: int = 1,
) -> Float[np.ndarray, "f k"]:
    """How much each completed scan says of each frame.

    The kernel is wide enough to reach two, and as many moments as are `needed`: scans may be
    neighbours and the next ones far away.
    """
    apart = np.abs(wanted[:, None] - at)
    second = _nth(apart, 2)
    farthest = _nth(np.abs(wanted[:, None] - _moments(at)), needed)
    width = np.maximum(np.maximum(smooth_ticks, second), farthest / _REACH)
    return np.exp(-0.5 * (apart / width) ** 2)


def _nth(apart: Float[np.ndarray, "f k"], number: int) -> Float[np.ndarray, "f 1"]:
    """The second smallest of each row, say, or the largest where there are fewer."""
    place = min(number, apart.shape[1]) - 1
    return np.sort(apart, axis=1)[:, place : place + 1]


def _lines(
    at: Float[np.ndarray, "k"],
    places: Float[np.ndarray, "k 3"],
    wanted: Float[np.ndarray, "f"],
    smooth_ticks: float,
) -> tuple[Float[np.ndarray, "f 3"], Float[np.ndarray, "f 3"]]:
    """Place and velocity a tick in each frame, of the line of weighted least squares around it."""
    weights = _weights(at, wanted, smooth_ticks, needed=2)
    weights /= weights.sum(1, keepdims=True)
    time = at - wanted[:, None]
    mean_time = (weights * time).sum(1, keepdims=True)
    mean_place = weights @ places
    spread = (weights * (time - mean_time) ** 2).sum(1, keepdims=True)
    velocities = (weights * (time - mean_time)) @ places / spread
    return mean_place - mean_time * velocities, velocities


def _parabolas(
    at: Float[np.ndarray, "k"],
    places: Float[np.ndarray, "k d"],
    wanted: Float[np.ndarray, "f"],
    smooth_ticks: float,
    trust: Float[np.ndarray, "k"] | float = 1.0,
) -> Float[np.ndarray, "f d"]:
    """Place in each frame, of the parabola of weighted least squares around it."""
    weights = trust * _weights(at, wanted, smooth_ticks, needed=3)
    time = (at - wanted[:, None]) / smooth_ticks
    powers = np.stack((np.ones_like(time), time, time**2), axis=-1)
    weighted = np.swapaxes(powers * weights[..., None], 1, 2)
    return np.linalg.solve(weighted @ powers, weighted @ places)[:, 0]


def _yaws(
    at: Float[np.ndarray, "k"],
    boxes: Float[np.ndarray, "k 4"],
    wanted: Float[np.ndarray, "f"],
    config: BoxConfig,
) -> Float[np.ndarray, "f"]:
    """Headings between those of the completed scans."""
    weights = _weights(at, wanted, config.smooth_ticks)
    return np.arctan2(weights @ np.sin(boxes[:, 3]), weights @ np.cos(boxes[:, 3]))
