# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A beam that turns meets what is beside a moving sensor before or after the turn's middle."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from tests.refusal import refused

from wildshape.drives.completing.boxes import smooth
from wildshape.drives.completing.level_frame import Completed, boxes_in_scans
from wildshape.drives.completing.rolling_shutter import TURNS, Turns, with_sense
from wildshape.drives.config import BoxConfig, DriveConfig, TurnConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.source import Drive
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.trajectory import Breaks
from wildshape.drives.writing.finished import FinishedDrive, FoundVehicle
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Turn

FRAMES = 20
STANDING = np.array([(8.0, 4.0, -1.0, 0.1), (14.0, -5.0, -1.0, 3.0), (22.0, 3.5, -1.0, -0.4)])


def sensor(ticks):
    """`T_level_sensor`: 1 m a tick in a bend of 2 degrees a tick."""
    turn = torch.tensor(np.deg2rad(2.0) * np.asarray(ticks, float))
    radius = 1.0 / np.deg2rad(2.0)
    place = radius * torch.stack((turn.sin(), 1 - turn.cos(), torch.zeros_like(turn)), -1)
    return SE3(rotation_z(turn), place)


def turns(sense=0):
    return Turns(tuple(range(FRAMES)), sensor(range(FRAMES)), sense)


def met(place_at, frame, sense):
    """Where the beam meets something, sensor frame, and when: the exact motion, step by step."""

    def seen(phase):
        T_level_sensor = sensor([frame + phase])[0]
        return T_level_sensor.inverse().apply_numpy(place_at(frame + phase)[None, :3])[0]

    phase = 0.0
    for _ in range(20):
        x, y, _ = seen(phase)
        phase = sense * np.arctan2(y, x) / (2 * np.pi)
    return seen(phase), phase


def shown(place_at, sense):
    """Where each frame shows something, as if met at the turn's middle, and when it was met."""
    boxes, phases = [], []
    for frame in range(FRAMES):
        seen, phase = met(place_at, frame, sense)
        yaw = place_at(frame + phase)[3] - np.deg2rad(2.0) * phase
        boxes.append((*sensor([frame])[0].apply_numpy(seen[None])[0], yaw))
        phases.append(phase)
    return np.array(boxes), np.array(phases)


@pytest.mark.parametrize("sense", [1, -1, 0])
def test_what_stands_is_found_in_one_place_and_tells_the_sense(sense):
    seen = [shown(lambda _, box=box: box, sense) for box in STANDING]
    frames = tuple(range(FRAMES))
    found = with_sense(turns(), [(frames, boxes) for boxes, _ in seen], TurnConfig())
    assert found.sense == sense
    assert not sense or np.ptp(seen[0][0][:, 0]) > 0.3
    for box, (boxes, phases) in zip(STANDING, seen):
        stood, when = found.met(frames, boxes)
        assert np.abs(stood - box).max() < 0.03
        assert when == pytest.approx(phases, abs=1e-9)
        assert found.shown(frames, stood) == pytest.approx(boxes, abs=0.01)


@pytest.mark.parametrize("sense", [1, -1])
def test_of_every_second_scan_a_turn_takes_half_of_the_time_between_them(sense):
    kept = np.arange(0, FRAMES, 2)
    seen = [shown(lambda _, box=box: box, sense)[0][kept] for box in STANDING]
    frames = tuple(range(len(kept)))
    fewer = Turns(frames, sensor(kept))
    found = with_sense(fewer, iter([(frames, boxes) for boxes in seen]), TurnConfig())
    assert found.sense == sense / 2
    for box, boxes in zip(STANDING, seen):
        assert np.abs(found.met(frames, boxes)[0] - box).max() < 0.03


@pytest.mark.parametrize("timed", [True, False])
def test_a_sense_is_looked_for_where_no_scan_has_times_not_where_the_first_is_empty(
    timed, tmp_path
):
    points = np.ones((5, 3), np.float32)
    read = [Turn(points[:0]), *[Turn(points, np.zeros(5) if timed else None)] * (FRAMES - 1)]
    names, at = [f"{frame:06d}" for frame in range(FRAMES)], [0.1 * i for i in range(FRAMES)]
    stands = [shown(lambda _, place=place: place, 1)[0] for place in STANDING]
    seen = [SimpleNamespace(frames=range(FRAMES), boxes=boxes) for boxes in stands]
    pipeline: Any = SimpleNamespace(
        drive=Drive.of("street", names, read.__getitem__, at),
        breaks=Breaks(),
        config=DriveConfig(),
        stages=tmp_path,
        completed=lambda *_: seen,
    )
    assert Pipeline.turns(pipeline, [], sensor(range(FRAMES))).sense == (0 if timed else 1)


def test_one_that_passes_fast_is_where_the_beam_meets_it():
    def oncoming(tick):
        return np.array((25.0 - 1.5 * tick, 4.0, -1.0, np.pi))

    boxes, _ = shown(oncoming, 1)
    frames = tuple(range(0, FRAMES, 2))
    stood, phases = turns(1).met(frames, boxes[list(frames)])
    seen = Sightings("a", tuple(range(FRAMES)), ((0,),) * FRAMES, (200,) * FRAMES)
    one = Completed(seen, frames, stood, (4.0, 1.8, 1.5), 0.1, 0.5, phases=phases)
    way = smooth(one, turns(1), BoxConfig())
    found = turns(1).shown(way.frames, way.boxes)
    assert np.abs(found - boxes)[:19, :2].max() < 0.06


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(
    ("own", "its", "aside", "start"),
    [(15, -15, 3.5, 45), (15, 5, -3.0, 15), (15, -15, 1.0, 30), (15, 14, 0.5, -10)],
)
def test_speeds_are_of_when_the_beam_meets_what_moves(sense, own, its, aside, start):
    """Beside and behind the sensor, too: there a scan shows it half a turn early or late.

    What stays behind, having passed or following, is met where turns end and begin.
    """
    count = 31
    time = 0.1 * np.arange(count)
    way = torch.from_numpy(np.column_stack((own * time, 0 * time, 0 * time)))
    T = SE3(torch.eye(3).double().repeat(count, 1, 1), way)
    turns = Turns(tuple(range(count)), T, sense)
    phase = np.zeros(count)
    for _ in range(30):
        met = time + 0.1 * phase
        phase = sense * np.arctan2(aside, start + (its - own) * met) / (2 * np.pi)
    met = time + 0.1 * phase
    yaw = np.full(count, 0.0 if its > 0 else np.pi)
    boxes = np.column_stack((start + its * met, np.full(count, aside), np.full(count, -1.0), yaw))
    size = 4.0, 1.8, 1.5
    shown = tuple(boxes_in_scans(turns.shown(np.arange(count), boxes), size, T))
    vehicle = FoundVehicle("a", size, 0.9, True, tuple(range(count)), shown, (100,) * count)
    names = tuple(f"{frame:06d}" for frame in range(count))
    known = Path(), names, tuple(time), tuple(10 * time), (1,) * count
    found = FinishedDrive(*known, T, turns, 1.7, (vehicle,), {"settings": {"source": "x"}})
    speeds = found.velocities(vehicle)
    assert np.abs(speeds - (its, 0.0, 0.0)).max() < 0.5


def test_turns_of_a_finished_drive_are_checked(tmp_path):
    T = SE3(torch.eye(3).double().repeat(3, 1, 1), torch.zeros(3, 3).double())
    assert Turns.read(tmp_path / TURNS, T).sense == 0  # of drives that were found before
    (tmp_path / TURNS).write_text('{"sense": -1, "ticks": [0, 1, 4]}')
    found = Turns.read(tmp_path / TURNS, T)
    assert (found.sense, found.ticks) == (-1, (0, 1, 4))
    (tmp_path / TURNS).write_text('{"sense": 0.5, "ticks": [0, 1, 4]}')
    assert Turns.read(tmp_path / TURNS, T).sense == 0.5
    for wrong in ('{"sense": 2, "ticks": [0, 1, 4]}', '{"sense": 1, "ticks": [0, 4, 1]}', "[]"):
        (tmp_path / TURNS).write_text(wrong)
        refused(Turns.read, tmp_path / TURNS, T, match="turns of a sensor")
