# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tracks hold, in numbers: points, ranges, viewing angles, lengths, categories, sensors.

A packed store's index alone answers most of it; what needs points is taken from a sample of
tracks, and every quantity says what it was taken from.
"""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Int

from wildshape.errors import BadInputError
from wildshape.io.inputs import TrackSource
from wildshape.io.sensor_json import sensor_from_json
from wildshape.io.store.store import Store
from wildshape.records import Sensor, Track
from wildshape.report.statistics.distributions import RunningDistribution
from wildshape.report.statistics.histogram import Tally

_BLOCK = 4096
_FARTHEST_M = 1e9


@dataclass(frozen=True)
class Quantity:
    """One distribution.

    Attributes:
        name: for machines.
        title: for people.
        unit: of the numbers; empty for counts.
        basis: what it was taken from, in words.
    """

    name: str
    title: str
    unit: str
    basis: str
    tally: Tally


@dataclass(frozen=True)
class Statistics:
    """What some tracks hold.

    Attributes:
        tracks: how many there are.
        scans: how many there are; None where not all tracks were read.
        points: of all scans, like `scans`.
        read: tracks whose points were read.
        quantities: the distributions, those that are known.
        categories: tracks of each.
        sensors: tracks by each, in words.
        sources: tracks from each.
        with_poses: tracks whose poses are known; None where not all tracks were read.
        with_shape: tracks whose shape is known, like `with_poses`.
        left_out: scans and objects that whoever made the tracks left out, by reason.
        unusable: tracks or scans that could not be read now, with the reason.
        provenance: how the tracks were made, as kept with them.
    """

    tracks: int
    scans: int | None
    points: int | None
    read: int
    quantities: tuple[Quantity, ...]
    categories: dict[str, int]
    sensors: dict[str, int]
    sources: dict[str, int]
    with_poses: int | None
    with_shape: int | None
    left_out: dict[str, int] = field(default_factory=dict)
    unusable: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)


def sample_of(count: int, wanted: int) -> list[int]:
    """Numbers of `wanted` of `count` tracks, drawn by chance, sorted; all of them for 0."""
    if not 0 < wanted < count:
        return list(range(count))
    return sorted(np.random.default_rng(0).choice(count, wanted, replace=False).tolist())


def statistics_of_store(store: Store, chosen: list[int], at: Callable[[int], None]) -> Statistics:
    """The numbers of a packed store; only the points of the chosen tracks are read.

    Raises:
        BadInputError: the store is damaged.
    """
    distribution, posed = RunningDistribution(), store.column("pose_starts") >= 0
    sizes = np.diff(store.track_starts)
    distribution.scans.add(sizes)
    for block in _blocks(len(store.scan_sizes), 1 << 20):
        distribution.points.add(store.scan_sizes[block])
    for block in _blocks(len(store), _BLOCK):
        _add_posed(distribution, store, np.arange(block.start, block.stop)[posed[block]], sizes)
    for done, number in enumerate(chosen, start=1):
        track = store.track(number)
        distribution.size(track)
        if not posed.any():
            distribution.scan_middles(track)
        at(done)
    return Statistics(
        tracks=len(store),
        scans=store.scan_count,
        points=int(store.scan_sizes.sum()),
        read=len(chosen),
        quantities=_quantities(distribution, _of_tracks(len(chosen), len(store)), "all"),
        categories=store.how_often("categories"),
        sensors=_sensors_of(store),
        sources=store.how_often("sources"),
        with_poses=int(posed.sum()),
        with_shape=int((store.column("shape_starts") >= 0).sum()),
    )


def statistics_of_tracks(
    source: TrackSource, chosen: list[int], at: Callable[[int], None]
) -> Statistics:
    """The numbers of tracks in files, of which the chosen ones are read, one held at a time.

    Raises:
        BadInputError: not a single one can be used; the message is that of the first.
    """
    distribution, counted = (
        RunningDistribution(),
        {name: Counter() for name in ("category", "sensor", "source")},
    )
    unusable: dict[str, str] = {}
    totals: Counter[str] = Counter()
    for done, number in enumerate(chosen, start=1):
        try:
            track = source[number]
        except BadInputError as error:
            unusable[source.names[number]] = str(error)
            continue
        _add_track(distribution, track)
        counted["category"][track.category] += 1
        counted["sensor"][_sensor_words(track.sensor)] += 1
        counted["source"][track.source] += 1
        totals.update(_totals(track))
        at(done)
    if not totals["tracks"]:
        raise BadInputError(next(iter(unusable.values())))
    whole = len(chosen) == len(source)
    of = _of_tracks(totals["tracks"], len(source), sampled=not whole)
    return Statistics(
        tracks=len(source),
        scans=totals["scans"] if whole else None,
        points=totals["points"] if whole else None,
        read=totals["tracks"],
        quantities=_quantities(distribution, of, of),
        categories=dict(counted["category"].most_common()),
        sensors=dict(counted["sensor"].most_common()),
        sources=dict(counted["source"].most_common()),
        with_poses=totals["posed"] if whole else None,
        with_shape=totals["shaped"] if whole else None,
        unusable=unusable | dict(source.skipped),
    )


def _totals(track: Track) -> dict[str, int]:
    return {
        "tracks": 1,
        "scans": len(track.scans),
        "points": sum(map(len, track.scans)),
        "posed": int(track.T_sensor_object is not None),
        "shaped": int(track.shape is not None),
    }


def _add_track(distribution: RunningDistribution, track: Track) -> None:
    distribution.points.add(np.asarray([len(scan) for scan in track.scans]))
    distribution.scans.add(np.asarray([len(track.scans)]))
    distribution.size(track)
    distribution.scan_middles(track)
    if track.T_sensor_object is not None:
        rotation, translation = track.T_sensor_object.rotation, track.T_sensor_object.translation
        distribution.views(rotation.numpy(), translation.numpy(), np.asarray([len(track.scans)]))


def _add_posed(
    distribution: RunningDistribution,
    store: Store,
    tracks: Int[np.ndarray, "t"],
    sizes: Int[np.ndarray, "all"],
) -> None:
    """The posed tracks of one block, from the index alone.

    Raises:
        BadInputError: a pose is none.
    """
    if not len(tracks):
        return
    count = sizes[tracks]
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    rows = store.column("poses")[np.repeat(store.column("pose_starts")[tracks], count) + within]
    if not (np.abs(rows) < _FARTHEST_M).all():
        raise BadInputError(f"{store.path}: a pose is not finite or far away; convert again.")
    distribution.views(rows[:, :, :3], rows[:, :, 3], count)


def _blocks(count: int, step: int) -> Iterator[slice]:
    return (slice(start, min(start + step, count)) for start in range(0, count, step))


def _sensors_of(store: Store) -> dict[str, int]:
    counted: Counter[str] = Counter()
    for raw, count in store.how_often("sensors").items():
        counted[_sensor_words(sensor_from_json(json.loads(raw), store.path))] += count
    return dict(counted.most_common())


def _sensor_words(sensor: Sensor) -> str:
    if sensor.resolution_deg is not None:
        return "{}, {:g} x {:g} degrees".format(sensor.kind, *sensor.resolution_deg)
    if sensor.intrinsics is not None:
        camera = sensor.intrinsics
        return f"{sensor.kind}, {camera.width} x {camera.height} px, f {camera.fx:.4g}"
    return sensor.kind


def _of_tracks(read: int, count: int, *, sampled: bool = True) -> str:
    """Which tracks were read; where they are no sample, the others cannot be."""
    return "all" if read == count else f"{'a sample of ' * sampled}{read:,} of {count:,}"


def _part(measured: int, of: int, what: str) -> str:
    """How many have what is shown, where not all do."""
    return "" if measured >= of else f", {measured:,} of {of:,} {what}"


_EXTENT_BASIS = {
    "shape": "truth shapes",
    "fused": "scans joined by truth",
    "scan": "the box of each track's longest scan, upright in its sensor's frame",
}


def _quantities(distribution: RunningDistribution, read: str, indexed: str) -> tuple[Quantity, ...]:
    """The distributions there are.

    `read` and `indexed`: which tracks' points were read, and which the rest is from, in words.
    """
    by_truth = distribution.seen[0].count > 0
    where = "object's frame, by truth" if by_truth else "sensor's frame, middle of each scan"
    seen = "viewpoint" if by_truth else "object"
    basis = f"{where}; {indexed if by_truth else read} tracks"
    ranges, azimuth, elevation = distribution.seen[:3] if by_truth else distribution.sensed
    if by_truth:
        basis += _part(ranges.count, distribution.points.count, "scans")
    kind = next((k for k, tallies in distribution.extents.items() if tallies[0].count), "scan")
    measured = {name: tallies[0].count for name, tallies in distribution.extents.items()}
    extents = f"{_EXTENT_BASIS[kind]}; {read} tracks"
    extents += _part(measured[kind], sum(measured.values()), "of these")
    found = (
        Quantity("points", "points per scan", "", f"{indexed} tracks", distribution.points),
        Quantity("scans", "scans per track", "", f"{indexed} tracks", distribution.scans),
        Quantity("range", "range", "m", basis, ranges),
        Quantity("azimuth", f"azimuth of the {seen}", "°", basis, azimuth),
        Quantity("elevation", f"elevation of the {seen}", "°", basis, elevation),
        Quantity("turn", "viewpoint change", "°", basis, distribution.seen[3]),
        Quantity("length", "length", "m", extents, distribution.extents[kind][0]),
        Quantity("width", "width", "m", extents, distribution.extents[kind][1]),
        Quantity("height", "height", "m", extents, distribution.extents[kind][2]),
    )
    return tuple(quantity for quantity in found if quantity.tally.count)
