# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What lies beside an object, other frames, and a second vehicle are told; a scan alone is not."""

import dataclasses

import numpy as np
import pytest

from wildshape.inference.confidence import ReasonCounts, reasons_of_object, reasons_sentence
from wildshape.inference.config import InferenceConfig, ReasonRule
from wildshape.inference.predictor import load
from wildshape.method.single_object import (
    looked_down_on,
    share_off,
    share_twice,
    unseen_height,
)
from wildshape.records import Box
from wildshape.simulate.generate import SimulationConfig, simulate_tracks

ODD = {"points_off_shape", "not_one_scan", "roof_not_seen"}


@pytest.fixture(scope="module")
def track():
    """A car 1.4 m high, from below the sensor's height."""
    config = SimulationConfig(tracks=4, scans=3, occlusion=0.0)
    return min(simulate_tracks(config, 77), key=lambda one: np.ptp(np.asarray(one.shape)[:, 2]))


@pytest.fixture(scope="module")
def model():
    return load()


def odd(done):
    return ODD & set(done.reasons)


def on_its_ground(track, i, around):
    """A scan with points on the ground, 10 cm apart, as far around its vehicle as said."""
    low, high = track.shape.min(0), track.shape.max(0)
    x, y = (np.arange(low[k] - around, high[k] + around, 0.1) for k in (0, 1))
    flat = np.stack(np.meshgrid(x, y, low[2]), -1).reshape(-1, 3)
    beside = ((flat < low) | (flat > high))[:, :2].any(1)
    ground = track.T_sensor_object[i].apply_numpy(flat[beside])
    return np.concatenate((track.scans[i], ground[::4])).astype(np.float32)


def along(track, i, metres):
    """How its vehicle looks so far ahead."""
    ahead = track.T_sensor_object[i].rotation[:, 0].numpy()
    return (track.scans[i] + metres * ahead).astype(np.float32)


def test_a_scan_of_one_vehicle_is_not_odd(model, track):
    for done in (*model.complete_many(track.scans), *model.complete_track(track.scans)):
        assert not odd(done)


def test_a_metre_of_ground_is_told_alone_and_in_a_track(model, track):
    """Two of three such scans had 0.8 and 0.96, their boxes half a metre too wide."""
    scans = [on_its_ground(track, i, 1.0) for i in range(len(track.scans))]
    alone = list(model.complete_many(scans))
    assert any(done.confidence > 0.5 for done in alone)
    for done in (*alone, *model.complete_track(scans)):
        assert {"points_off_shape", "low_confidence"} & set(done.reasons)
    assert sum("points_off_shape" in done.reasons for done in alone) >= 2


def test_frames_put_together_unaligned_are_told(model, track):
    for i in range(len(track.scans)):
        smeared = np.concatenate([along(track, i, metres) for metres in (0.0, 0.7, 1.4)])
        assert "not_one_scan" in model.complete(smeared).reasons


def test_two_cars_bumper_to_bumper_are_told(model, track):
    """They were one lorry of 3 m, half of which no ray had met, with a confidence of 0.7."""
    length = np.ptp(track.shape[:, 0])
    for i in range(len(track.scans)):
        pair = np.concatenate((track.scans[i], along(track, i, length + 0.8)))
        assert odd(model.complete(pair))


def test_the_probabilities_and_the_shape_stay(model, track):
    """What is odd is said, and changes nothing else."""
    never = ReasonRule(off_share=1.0, twice_share=1.0)
    scan = on_its_ground(track, 0, 1.0)
    told = model.complete(scan)
    silent = load(config=InferenceConfig(reasons=never)).complete(scan)
    assert not odd(silent) - {"roof_not_seen"}
    assert (told.confidence, told.p_box, told.box) == (silent.confidence, silent.p_box, silent.box)
    np.testing.assert_array_equal(told.points, silent.points)


def test_what_lies_off_a_shape_is_counted_wherever_it_is():
    shape = np.random.default_rng(0).uniform(-1, 1, (4000, 3)).astype(np.float32)
    scan = np.concatenate((shape[:97], [[0, 0, 1.4], [0, 0, 1.8], [0, 5, 0]])).astype(np.float32)
    for place in ((0, 0, 0), (900, -400, 3)):
        moved = [(part + np.array(place)).astype(np.float32) for part in (scan, shape)]
        assert share_off(*moved, far=0.5) == pytest.approx(0.02)
        assert share_off(*moved, far=0.2) == pytest.approx(0.03)


def rays(step_deg, ranges):
    azimuth = np.radians(step_deg) * np.arange(len(ranges))
    turned = np.stack((np.cos(azimuth), np.sin(azimuth), np.zeros(len(ranges))), -1)
    return (turned * np.asarray(ranges)[:, None]).astype(np.float32)


def test_two_ranges_in_one_direction_are_no_single_scan():
    ranges = 10 + np.arange(100) % 2  # from one ray to the next a metre
    scan = rays(0.1, ranges)
    assert share_twice(scan, 0.06, 0.5) == 0
    assert share_twice(scan, 0.2, 0.5) == 1
    behind = np.concatenate((scan, 1.1 * scan[:10]))  # in the very same directions
    assert share_twice(behind.astype(np.float32), 0.06, 0.5) == pytest.approx(20 / 110)
    assert share_twice(behind.astype(np.float32), 0.06, 1.2) == 0


def test_a_roof_is_looked_for_only_below_the_sensor():
    box = Box((10.0, 0.0, 0.0), (4.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0))
    low = np.random.default_rng(0).uniform((10, -1, -1.5), (10, 1, -0.5), (500, 3))
    low = low.astype(np.float32)
    assert unseen_height(low, box) == pytest.approx(2.0, abs=0.05)
    assert looked_down_on(low)
    shape = np.concatenate((low, low + np.array((0, 0, 1), np.float32)))
    assert reasons_of_object(low, low, shape, box, 1.0) == ("roof_not_seen",)
    # Above its own level a sensor may see nothing.
    above = low + np.array((0, 0, 0.7), np.float32)
    high = dataclasses.replace(box, centre=(10.0, 0.0, 0.7))
    assert unseen_height(above, high) == pytest.approx(2.0, abs=0.05)
    assert reasons_of_object(above, above, above, high, 1.0) == ()


def test_the_cure_is_told(model, track):
    """Of one, and of many, whose first in doubt has none."""
    alone = model.complete(track.scans[0])
    unsure = dataclasses.replace(alone, reasons=("unsure_box",))
    beside = dataclasses.replace(alone, reasons=("unsure_box", "points_off_shape"))
    assert "unsure box, points off shape (cut out the object alone, " in reasons_sentence(beside)
    counts = ReasonCounts().of(("a", "b", "c"), (unsure, beside, unsure))
    assert counts.sentence.startswith("3 of 3 results are not to be trusted: unsure box 3, ")
    assert "for example b: cut out the object alone, without ground" in counts.sentence
