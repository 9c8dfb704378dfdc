# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Who is on a street: parked and moving vehicles, people who walk or stand."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count, islice

import numpy as np

from wildshape.simulate.street.street import LANE_M, LEAD_M, Actor, Motion, Street

_KINDS = {"van": "Van", "truck": "Truck"}
_LONGEST_M, _WIDEST_PARKED_M = 9.5, 2.45
_LEAST_ROOM_M = 1.0  # between two of one lane
_TRIES = 32  # vehicles drawn for a place at the kerb
Seats = Iterator[Actor]


@dataclass(frozen=True)
class _Stretch:
    """A street with the part of it that is filled, metres, and for how long, seconds."""

    street: Street
    low: float
    high: float
    seconds: float


def traffic(street: Street, end: float, seconds: float, seed: int) -> tuple[Actor, ...]:
    """All actors of a street, numbered; no two vehicles meet on it, none comes near the sensor's.

    Those that have driven past its end all stand there, one in another, far from the sensor.
    """
    rng = np.random.default_rng([seed, 1])
    stretch = _Stretch(street, -LEAD_M, end, seconds)
    drawn = (_drawn(street, seed, track) for track in count())
    actors: list[Actor] = []
    for side in (-1.0, 1.0):
        actors += _parked(stretch, drawn, side, rng)
        actors += _on_plots(stretch, drawn, side, rng)
    actors += _same_lane(stretch, drawn, rng)
    actors += _oncoming(stretch, drawn, rng)
    people = range(int((end + LEAD_M) / 12))
    actors += [_walker(stretch, (seed, 6, number), rng) for number in people]
    return tuple(replace(actor, track=number) for number, actor in enumerate(actors))


def _drawn(street: Street, seed: int, track: int) -> Actor:
    """A vehicle that has no place yet."""
    actor = Actor(track, "Car", (0.0, 0.0, 0.0), Motion(0.0), 0.0, 0.0, (seed, 2, track))
    return _sized(street, actor)


def _sized(street: Street, actor: Actor) -> Actor:
    shape = street.shape(actor)
    length, width, height = (float(side) for side in np.ptp(shape.bounds, axis=0))
    return replace(actor, size=(length, width, height), kind=_KINDS.get(shape.kind, actor.kind))


def _parked(
    stretch: _Stretch, drawn: Seats, side: float, rng: np.random.Generator
) -> Iterator[Actor]:
    """Along the kerb, on straight parts: at a density of the street's own, with gaps."""
    taken, street = float(rng.uniform(0.4, 0.85)), stretch.street
    s = stretch.low
    while s < stretch.high:
        if rng.random() > taken or not street.is_straight(s + 3.0):
            s += float(rng.uniform(4.0, 8.0))
            continue
        narrow = (one for one in islice(drawn, _TRIES) if one.size[1] < _WIDEST_PARKED_M)
        actor = next(narrow, None)
        if actor is None:
            return  # the user's own vehicles are all too wide
        length, width, _ = actor.size
        lateral = side * (street.half_m - width / 2 - rng.uniform(0.08, 0.35))
        backward = (side > 0) != (rng.random() < 0.15)
        heading = np.pi * backward + np.radians(rng.normal(0.0, 1.0))
        yield replace(
            actor, motion=Motion(s + length / 2), lateral=float(lateral), heading=float(heading)
        )
        s += length + float(rng.uniform(0.6, 1.8))


def _on_plots(
    stretch: _Stretch, drawn: Seats, side: float, rng: np.random.Generator
) -> Iterator[Actor]:
    """Behind the pavement, across the street or along it, now and then."""
    street, s = stretch.street, stretch.low + float(rng.uniform(0.0, 30.0))
    while s < stretch.high:
        if street.is_straight(s):
            actor = next(drawn)
            across = rng.random() < 0.7
            reach = actor.size[0 if across else 1] / 2
            lateral = side * (street.half_m + street.walk_m + reach + rng.uniform(0.3, 3.0))
            heading = np.radians(rng.normal(0.0, 4.0)) + np.pi * rng.integers(0, 2)
            heading += np.pi / 2 * across
            motion = Motion(s)
            yield replace(actor, motion=motion, lateral=float(lateral), heading=float(heading))
        s += float(rng.uniform(11.0, 50.0))


def _same_lane(stretch: _Stretch, drawn: Seats, rng: np.random.Generator) -> Iterator[Actor]:
    """Before and behind the sensor's vehicle, at nearly its speed, never coming nearer.

    One that would run into its neighbour before the drive ends goes as fast as that.
    """
    ego = stretch.street.ego
    for sign in (1.0, -1.0):
        gap, neighbour = 0.0, None
        for number in range(int(rng.integers(0, 4))):
            vehicle = next(drawn)
            gap += float(rng.uniform(11.0, 26.0)) + (_LONGEST_M / 2 if number else 0.0)
            gap += _over(vehicle) + (_over(neighbour) if neighbour else 0.0)
            more = sign * 0.05 * (number + 1) * ego.speed * float(rng.uniform(0.0, 1.0))
            motion = replace(ego, start=ego.start + sign * gap, speed=ego.speed + more)
            if ego.speed == 0:
                motion = replace(motion, speed=0.0)
            actor = replace(vehicle, motion=motion, lateral=-LANE_M / 2)
            if neighbour and _room(neighbour, actor, sign, stretch.seconds) < _LEAST_ROOM_M:
                actor = replace(actor, motion=replace(motion, speed=neighbour.motion.speed))
            neighbour = actor
            yield actor


def _over(actor: Actor) -> float:
    """How much farther than the longest of ours it reaches to either side, metres."""
    return max(0.0, actor.size[0] - _LONGEST_M) / 2


def _room(one: Actor, other: Actor, sign: float, time: float) -> float:
    """Metres between two of one lane; `sign`: 1: the other is ahead, -1: behind."""
    ahead = float(other.motion.at(time) - one.motion.at(time))
    return sign * ahead - (one.size[0] + other.size[0]) / 2


def _oncoming(stretch: _Stretch, drawn: Seats, rng: np.random.Generator) -> Iterator[Actor]:
    """In the other lane, one speed for all."""
    speed = -float(rng.uniform(5.0, 11.0))
    s = stretch.low + float(rng.uniform(0.0, 40.0))
    before = 0.0
    while s < stretch.high - speed * stretch.seconds:
        vehicle = next(drawn)
        s += before + _over(vehicle)
        yield replace(vehicle, motion=Motion(s, speed), lateral=LANE_M / 2, heading=np.pi)
        s += _LONGEST_M + 3.0 + float(rng.exponential(25.0))
        before = _over(vehicle)


def _walker(stretch: _Stretch, seed: tuple[int, ...], rng: np.random.Generator) -> Actor:
    """A person on a pavement."""
    street = stretch.street
    pace = float(rng.choice((-1.0, 1.0)) * rng.uniform(0.8, 1.6) * (rng.random() < 0.75))
    beside = street.half_m + 1.15 + rng.uniform(0.0, street.walk_m - 2.3)
    motion = Motion(float(rng.uniform(stretch.low, stretch.high)), pace)
    lateral = float(rng.choice((-1.0, 1.0)) * beside)
    standing = Actor(0, "Pedestrian", (0.0, 0.0, 0.0), motion, lateral, np.pi * (pace < 0), seed)
    return _sized(street, standing)
