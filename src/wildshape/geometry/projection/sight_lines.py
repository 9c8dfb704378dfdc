# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The rays of a frame around an object, and what they say of a shape.

A ray that ended before a point hides it. A ray that went on says that nothing stands there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from wildshape.errors import BadInputError

_UNIT = 1e-3  # how far from 1 the length of a direction may be
_ALIKE = math.cos(math.radians(45.0))  # between places that see much the same side of an object


@dataclass(frozen=True, eq=False)
class SightLines:
    """Rays of a frame near an object that did not hit it.

    Attributes:
        directions: `(m, 3)` float32 unit vectors, sensor frame.
        ranges: `(m,)` float32 metres; infinite where the sensor's grid says that nothing came back.
        origins: `(m, 3)` float32 where the rays start, sensor frame, metres, where several sensors
            are merged; None: all at the sensor.
    """

    directions: np.ndarray
    ranges: np.ndarray
    origins: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Refuse what are no rays.

        Raises:
            BadInputError: shapes that do not fit each other, a direction that is no unit vector, a
                range that is not above 0, an origin that is not finite.
        """
        for name in ("directions", "ranges", "origins"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _as_floats(name, value))
        count = len(self.ranges)
        expected = {"ranges": (count,), "directions": (count, 3), "origins": (count, 3)}
        for name, shape in expected.items():
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise BadInputError(
                    f"rays: {name} {value.shape} do not fit ranges {self.ranges.shape};"
                    f" expected {shape}."
                )
        lengths = np.linalg.norm(self.directions, axis=1)
        if not (np.abs(lengths - 1) <= _UNIT).all():
            raise BadInputError("rays: a direction is no unit vector; divide each by its length.")
        if not (self.ranges > 0).all():
            raise BadInputError(
                "rays: a range is not above 0; leave such rays out, or give infinity where nothing"
                " came back."
            )
        if self.origins is not None and not np.isfinite(self.origins).all():
            raise BadInputError("rays: an origin is not finite; leave such rays out.")

    def __len__(self) -> int:
        return len(self.ranges)

    @classmethod
    def of_returns(
        cls, points: Float[np.ndarray, "m 3"], origins: Float[np.ndarray, "m 3"] | None = None
    ) -> "SightLines":
        """The rays that ended in points; no point lies where its ray starts."""
        away = points.astype(np.float64) if origins is None else points - origins.astype(np.float64)
        ranges = np.linalg.norm(away, axis=1)
        return cls(away / ranges[:, None], ranges, origins)

    @classmethod
    def joined(cls, parts: "Sequence[SightLines]") -> "SightLines":
        """All rays of several sets, one after the other."""
        origins = None
        if any(part.origins is not None for part in parts):
            origins = np.concatenate([part.starts for part in parts])
        directions = np.concatenate([part.directions for part in parts])
        return cls(directions, np.concatenate([part.ranges for part in parts]), origins)

    @property
    def starts(self) -> Float[np.ndarray, "m 3"]:
        """Where the rays start, metres; zeros at the sensor itself."""
        return np.zeros_like(self.directions) if self.origins is None else self.origins

    @property
    def ends(self) -> Float[np.ndarray, "m 3"]:
        """Where the rays end, metres; infinite where nothing came back."""
        return self.starts + self.directions * self.ranges[:, None]

    @property
    def returned(self) -> "SightLines":
        """Those that came back."""
        return self.part(np.flatnonzero(np.isfinite(self.ranges)))

    def part(self, rows: Int[np.ndarray, "k"]) -> "SightLines":
        """Some of the rays."""
        origins = None if self.origins is None else self.origins[rows]
        return SightLines(self.directions[rows], self.ranges[rows], origins)

    def moved(
        self, rotation: Float[np.ndarray, "3 3"], translation: Float[np.ndarray, "3"]
    ) -> "SightLines":
        """The same in another frame a, by both parts of `T_a_sensor`; a turn alone adds no origins.

        Plain arrays: what only simulates does without torch.
        """
        turned = self.directions @ rotation.T
        if self.origins is None and not translation.any():
            return replace(self, directions=turned)
        return replace(self, directions=turned, origins=self.starts @ rotation.T + translation)


def _as_floats(name: str, value: object) -> Float[np.ndarray, "..."]:
    if np.ma.is_masked(value):
        raise BadInputError(f"rays: {name} are masked in part; leave such rays out.")
    try:
        numbers = np.asarray(value)
        if numbers.dtype.kind == "c":  # numpy would drop the imaginary parts
            raise TypeError
        return np.ascontiguousarray(numbers, np.float32)
    except (TypeError, ValueError) as error:
        raise BadInputError(f"rays: {name} are no array of numbers.") from error


class Standing(NamedTuple):
    """What the rays say of each point of a shape.

    Attributes:
        free: rays passed it, so that nothing can stand there.
        hidden: something nearer than it, no part of the object, ended the rays.
    """

    free: Bool[np.ndarray, "n"]
    hidden: Bool[np.ndarray, "n"]


def standing(
    points: Float[np.ndarray, "n 3"],
    scan: Float[np.ndarray, "s 3"],
    rays: SightLines,
    *,
    beyond_m: float = 0.1,
    within_m: float = 0.15,
    nearest: int = 3,
) -> Standing:
    """Which points of a shape stand where rays passed freely, and which are hidden.

    The rays that pass a point nearest are asked, the object's own returns among them, and they
    must agree: at a silhouette, and over a flat roof, one ray alone passes what the next one hits.
    Rays of which nothing came back say nothing: dark paint and glass swallow them, too. Where
    several sensors are merged, what one of them saw through is free; where they see the object from
    different sides, a return beyond a point may be another one's, and says nothing.

    Args:
        points: of a shape, sensor frame, metres.
        scan: the object's own returns, the same frame.
        rays: those that did not hit it.
        beyond_m: a ray passed a point, or ended before it, by at least this.
        within_m: rays that pass farther away say nothing of a point.
        nearest: how many rays must agree, as far as so many pass near.
    """
    free, hidden = np.zeros(len(points), bool), np.zeros(len(points), bool)
    returned = rays.returned
    places = _by_origin(returned)
    apart = _are_apart(np.array([origin for origin, _ in places]), scan)
    for origin, rows in places:
        seen = scan - origin.astype(scan.dtype)
        own = SightLines.of_returns(seen[seen.any(axis=1)])  # a point at the sensor is no return
        others = returned if rays.origins is None else returned.part(rows)
        directions = np.concatenate((own.directions, others.directions))
        ranges = np.concatenate((own.ranges, others.ranges))
        ray, beyond = _nearest(points - origin, directions, ranges, within_m, nearest)
        if apart:
            beyond[(ray < len(own)) & (beyond > beyond_m)] = np.nan
        known = np.isfinite(beyond).any(1)
        free |= known & (np.where(np.isfinite(beyond), beyond, np.inf).min(1) > beyond_m)
        before = (beyond < -beyond_m) & (ray >= len(own))
        hidden |= known & (before | ~np.isfinite(beyond)).all(1)
    return Standing(free, hidden & ~free)


def seen_alike(
    starts: Float[np.ndarray, "m 3"], start: Float[np.ndarray, "3"], middle: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, "m"]:
    """From which places an object is seen from much the same side as from another place."""
    toward, from_there = middle - starts, middle - start
    lengths = np.linalg.norm(toward, axis=1) * np.linalg.norm(from_there)
    return toward @ from_there >= _ALIKE * lengths


def _are_apart(places: Float[np.ndarray, "k 3"], scan: Float[np.ndarray, "s 3"]) -> bool:
    """Whether an object is seen from different sides."""
    middle = scan.mean(0)
    return not all(seen_alike(places, place, middle).all() for place in places)


def _by_origin(rays: SightLines) -> list[tuple[Float[np.ndarray, "3"], Int[np.ndarray, "k"]]]:
    """Each place from which rays start, and the rows of its rays."""
    if rays.origins is None:
        return [(np.zeros(3), np.arange(len(rays)))]
    places, which = np.unique(np.round(rays.origins, 2), axis=0, return_inverse=True)
    which = which.reshape(-1)
    return [(place, np.flatnonzero(which == i)) for i, place in enumerate(places)]


def _nearest(
    points: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "m 3"],
    ranges: Float[np.ndarray, "m"],
    within_m: float,
    count: int,
) -> tuple[Int[np.ndarray, "n k"], Float[np.ndarray, "n k"]]:
    """The rays nearest to each point, and how far behind it they ended; NaN of those not near."""
    import torch

    from wildshape.ops.nearest import nearest_k

    away = np.maximum(np.linalg.norm(points, axis=1), 1e-9)[:, None]
    query, target = (
        torch.from_numpy(part.astype(np.float32))[None] for part in (points / away, directions)
    )
    most = within_m / float(away.min(initial=np.inf))
    found = nearest_k(query, target, min(count, len(ranges)), most=most)
    apart, ray = found.distance_squared[0].sqrt().numpy(), found.index[0].numpy()
    beyond = ranges[ray].astype(np.float64) - away
    return ray, np.where(apart * away <= within_m, beyond, np.nan)
