# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes of long tracks, of which few scans are completed."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from tests.drives.objects import completed, still

from wildshape.drives.completing.boxes import expected, smooth
from wildshape.drives.completing.completion import keyframes
from wildshape.drives.config import BoxConfig, CompletionConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.sightings import Sightings
from wildshape.records import Turn

NO_POINTS = Turn(np.empty((0, 3), np.float32))


def driving(frames, phases=()):
    """One that drives 1.2 m a tick, each of its boxes a few centimetres off."""
    at = np.add(frames, phases or [0.0] * len(frames))
    boxes = np.column_stack((1.2 * at, 0.3 * at, 0 * at, np.full(len(at), np.arctan2(0.3, 1.2))))
    boxes[:, :2] += np.random.default_rng(0).normal(0, 0.03, (len(at), 2))
    return completed(boxes, frames, phases=phases)


def off(way):
    """How far boxes are from where it drives, metres."""
    at = np.array(way.frames)
    return np.linalg.norm(way.boxes[:, :2] - np.column_stack((1.2 * at, 0.3 * at)), axis=1).max()


@pytest.mark.parametrize(
    "frames", [(0, 29, 30, 75, 80, 119, 120, 170), (0, 1, 70, 120, 121, 170, 230, 231)]
)
def test_completed_scans_that_are_neighbours_with_the_next_far_away(frames):
    assert off(smooth(driving(frames), still(frames[-1] + 1), BoxConfig())) < 1.0


def test_one_that_brakes_and_turns_for_forty_seconds_is_where_it_drives():
    t = np.arange(400)
    speed, yaw = 0.6 + 0.6 * np.sin(t / 24), 0.6 * np.sin(t / 19)
    steps = speed[:, None] * np.column_stack((np.cos(yaw), np.sin(yaw)))
    true = np.column_stack((np.cumsum(steps, axis=0), 0 * t, yaw))
    points = np.random.default_rng(0).poisson(300, len(t)).tolist()
    seen = Sightings("a", tuple(t.tolist()), ((0,),) * len(t), tuple(points))
    frames = keyframes(seen, CompletionConfig()).frames
    way = smooth(completed(true[list(frames)], frames), still(len(t)), BoxConfig())
    off_m = np.linalg.norm(way.boxes[:, :2] - true[list(way.frames), :2], axis=1)
    assert np.median(off_m) < 0.1
    assert off_m.max() < 1.0


def test_two_scans_of_one_moment_tell_no_velocity():
    """The beam ends a turn on what is right behind the sensor, and begins the next one on it."""
    one = driving((0, 40, 80, 81), (0.0, 0.0, 0.5, -0.499))
    assert off(expected(one, still(120), 15, BoxConfig())) < 1.0
    pairs = driving((0, 1, 80, 81), (0.5, -0.499, 0.5, -0.499))
    assert off(smooth(pairs, still(82), BoxConfig())) < 1.0


def test_short_gaps_have_boxes_and_long_ones_none():
    one = completed([(0.0, 0.0, 0.0, 0.0)] * 2, (0, 40))
    seen = replace(one, seen=one.seen.part([0, 1, 11, 40]))
    way = smooth(seen, still(41), BoxConfig(longest_gap=10))
    assert way.frames == (*range(12), 40)


def test_what_stands_takes_no_more_memory_in_a_longer_drive():
    one, turns = completed([(0.0, 0.0, 0.0, 0.0)] * 3), still(20000)
    tracemalloc.start()
    way = expected(one, turns, 15, BoxConfig())
    taken, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(way.boxes) == len(way.frames) == 20000
    assert taken < 10_000


@pytest.mark.parametrize("clock", [0.0, 1.7e9])
def test_the_way_is_smooth_in_seconds_where_steps_are_uneven(clock):
    """At 12 m/s by whole scans it is 0.34 m off."""
    times = np.cumsum([0.0, *(0.08, 0.12, 0.08, 0.12, 0.08, 0.16) * 10])
    drive = Drive.of("drive", ["a"] * 61, lambda _: NO_POINTS, (clock + times).tolist())
    frames = tuple(sorted({*range(0, 61, 3), *range(0, 61, 4)}))
    places = np.column_stack((12 * times, 0 * times, 0 * times, 0 * times))
    one = completed(places[list(frames)], frames)
    way = smooth(one, replace(still(61), ticks=drive.moments), BoxConfig())
    assert np.linalg.norm(way.boxes[:, :2] - places[:, :2], axis=1).max() < 0.02


def test_even_steps_are_whole_ticks_by_any_clock():
    for clock in (0.0, 1.7e9):
        times = [clock + 0.1 * n for n in range(500) if n != 7]
        drive = Drive.of("drive", ["a"] * 499, lambda _: NO_POINTS, times)
        assert drive.moments == drive.ticks
