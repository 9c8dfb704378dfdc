# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When the beam of a turning sensor meets a vehicle, and where the vehicle then stands.

A turn takes as long as there is between two scans, or half as long where every second scan was
left out. Where points have no times, a scan shows everything as if it were met at the turn's
middle, when the beam faces forward. What is beside the sensor is met a quarter of a turn before or
after, and the sensor has moved by then.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from wildshape.drives.object_config import TurnConfig
from wildshape.drives.source import HALF_TICK
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io.guard import read_json, reading

TURNS = "turns.json"
"""File of a drive's stages: what is known of its turns."""
_LATEST = 2**53  # scans
_STEPS = 3  # where a box is shown depends on when it is met, and the reverse
_WHOLE, _HALF = (0, 1, -1), (0, 0.5, -0.5)
_SENSES = _WHOLE + _HALF

_Boxes = Float[np.ndarray, "k 4"]
_Frames = Sequence[int] | Int[np.ndarray, "k"]


@dataclass(frozen=True)
class Turns:
    """The turns of a sensor, one a frame.

    Attributes:
        ticks: of their middles, in parts of scans where steps are uneven.
        T_level_sensor: at their middles.
        sense: 1: the beam comes from behind over the right side and the front, counterclockwise
            from above; -1: over the left side; 0: points are as seen at the turn's middle. 0.5 and
            -0.5: the turn takes half of the time between two scans.
        breaks: frames whose place is guessed from the frame before.
    """

    ticks: tuple[int | float, ...]
    T_level_sensor: SE3
    sense: int | float = 0
    breaks: tuple[int, ...] = ()

    @classmethod
    def read(cls, path: Path, T_level_sensor: SE3) -> "Turns":
        """Of a finished drive; of one without the file all is taken for seen at its turn's middle.

        Raises:
            BadInputError: the file is damaged.
        """
        if not path.is_file():
            return cls(tuple(range(len(T_level_sensor))), T_level_sensor)
        with reading(path, "the turns of a sensor"):
            said = read_json(path, "the turns of a sensor")
            ticks = tuple(map(float, said["ticks"]))
            rising = all(before < after <= _LATEST for before, after in pairwise((-1, *ticks)))
            if said["sense"] not in _SENSES or len(ticks) != len(T_level_sensor) or not rising:
                raise ValueError(f"sense {said['sense']!r}, {len(ticks)} scans")
            return cls(ticks, T_level_sensor, said["sense"])

    def unbroken(self, first: int, last: int) -> range:
        """Two frames and all around them, up to the next breaks."""
        start = max((frame for frame in self.breaks if frame <= first), default=0)
        stop = min((frame for frame in self.breaks if frame > last), default=len(self.ticks))
        return range(start, stop)

    def met(self, frames: _Frames, shown: _Boxes) -> tuple[_Boxes, Float[np.ndarray, "k"]]:
        """Where things stood that frames show, and when the beam met each: see `phases`.

        Args:
            frames: one a box.
            shown: centre x, y, z and yaw, level world, as if met at the turn's middle.
        """
        rows = np.asarray(frames)
        phase = self._phase(rows, shown)
        return shown + self._carried(rows, shown, phase), phase

    def shown(self, frames: _Frames, boxes: _Boxes) -> _Boxes:
        """The reverse: where each frame shows what stood there when the beam met it."""
        rows, found = np.asarray(frames), boxes
        for _ in range(_STEPS if self.sense else 0):
            found = boxes - self._carried(rows, found, self._phase(rows, found))
        return found

    def phases(self, frames: _Frames, boxes: _Boxes) -> Float[np.ndarray, "k"]:
        """When the beam meets what stands there, in turns since the middle of the frame's."""
        return self._phase(np.asarray(frames), self.shown(frames, boxes))

    def _phase(self, rows: Int[np.ndarray, "k"], shown: _Boxes) -> Float[np.ndarray, "k"]:
        ahead = self.T_level_sensor.rotation.numpy()[rows, :2, :2]
        off = shown[:, :2] - self._origins[rows, :2]
        x, y = np.einsum("kji,kj->ik", ahead, off)
        return self.sense * np.arctan2(y, x) / (2 * np.pi)

    def _carried(
        self, rows: Int[np.ndarray, "k"], shown: _Boxes, phase: Float[np.ndarray, "k"]
    ) -> _Boxes:
        """How far the sensor carries each place with it up to its phase of the turn."""
        linear, angular = self._motion(rows)
        arm = shown[:, :3] - self._origins[rows]
        moved = linear + np.cross(angular, arm)
        return phase[:, None] * np.column_stack((moved, angular[:, 2]))

    def _motion(
        self, rows: Int[np.ndarray, "k"]
    ) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k 3"]]:
        """Velocity and turn of the sensor a tick, level world, from the frames around each."""
        before, after = np.maximum(rows - 1, 0), np.minimum(rows + 1, len(self.ticks) - 1)
        since = np.take(self.ticks, after) - np.take(self.ticks, before)
        since = np.maximum(since, HALF_TICK)[:, None]
        R = self.T_level_sensor.rotation.numpy()
        turn = R[after] @ np.swapaxes(R[before], 1, 2)
        twice = turn - np.swapaxes(turn, 1, 2)
        angular = np.column_stack((twice[:, 2, 1], twice[:, 0, 2], twice[:, 1, 0])) / 2
        return (self._origins[after] - self._origins[before]) / since, angular / since

    @property
    def _origins(self) -> Float[np.ndarray, "n 3"]:
        return self.T_level_sensor.translation.numpy()


def with_sense(
    turns: Turns, objects: Iterable[tuple[_Frames, _Boxes]], config: TurnConfig
) -> Turns:
    """The turns in the sense in which what stands stays most nearly in one place.

    Half turns are tried where whole ones tell nothing.

    Args:
        turns: without a sense.
        objects: frames of each, and its boxes where they show it.
        config: see there.
    """
    seen = [one for one in objects if len(one[0]) >= config.fewest_scans]
    whole = _clearest(turns, seen, _WHOLE, config.clearer, config)
    return whole if whole.sense else _clearest(turns, seen, _HALF, config.half_clearer, config)


def _clearest(
    turns: Turns,
    objects: Sequence[tuple[_Frames, _Boxes]],
    senses: Sequence[int | float],
    clearer: float,
    config: TurnConfig,
) -> Turns:
    """The turns in the best of some senses, the first of which is 0.

    An object counts as much as its place depends on the sense.
    """
    every = [replace(turns, sense=sense) for sense in senses]
    total = np.zeros(len(every))
    for frames, shown in objects:
        met = [one.met(frames, shown)[0] for one in every]
        spread = np.array([_spread(boxes) for boxes in met])
        if spread.min() < config.standing_m:
            total += _spread(met[1] - shown) * spread
    best = int(total.argmin())
    return every[best] if total[best] < clearer * total[0] else turns


def _spread(boxes: _Boxes) -> float:
    """How far from their middle place half of the boxes are."""
    places = boxes[:, :2]
    return float(np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1)))
