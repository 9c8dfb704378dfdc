# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks of one standing object are one: what hides a parked car does not make two of it."""

import math

import numpy as np
import pytest
import torch
from tests.drives.cuts import write_cut

from wildshape.drives.config import StandConfig
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.static_tracks import joined_where_they_stand
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3

FRAMES = 40
LEFT, REAR, WHOLE = ((0.0, 4.2), (0.0, 0.6)), ((0.0, 1.5), (0.0, 1.8)), ((0.0, 4.2), (0.0, 1.8))


@pytest.fixture
def drive(tmp_path):
    """Cuts of a sensor that turns while it drives, and what joins tracks of them."""
    frames = torch.arange(FRAMES).double()
    T_level_sensor = SE3(
        rotation_z(0.02 * frames), torch.stack((0.5 * frames, 0 * frames, 1.7 + 0 * frames), 1)
    )
    seen: dict[int, list[np.ndarray]] = {frame: [] for frame in range(FRAMES)}
    tracks = []

    def add(frames, part, at=lambda frame: (8.0, 5.0), yaw=0.4):
        """A track that saw a part, as x and y of a car's own frame, where the car was then."""
        rng, rows = np.random.default_rng(len(tracks)), []
        low, high = np.array((*part, (0.2, 1.4))).T
        c, s = math.cos(yaw), math.sin(yaw)
        for frame in frames:
            own = rng.uniform(low, high, (80, 3))
            world = own @ np.array(((c, s, 0), (-s, c, 0), (0, 0, 1))) + (*at(frame), 0.0)
            scan = T_level_sensor[frame].inverse().apply_numpy(world).astype(np.float32)
            rows.append(len(seen[frame]))
            seen[frame].append(scan)
        tracks.append(
            Sightings(
                f"{len(tracks):04d}",
                tuple(frames),
                tuple((row,) for row in rows),
                (80,) * len(rows),
            )
        )

    def joined(breaks=()):
        for frame, parts in seen.items():
            write_cut(tmp_path, frame, parts, sum(map(len, parts)))
        return joined_where_they_stand(tracks, tmp_path, T_level_sensor, StandConfig(), breaks)

    return add, joined


def test_two_views_of_a_parked_car_are_one_track_under_the_first_s_name(drive):
    add, joined = drive
    add(range(10), LEFT)
    add(range(25, 33), REAR)
    add(range(12, 14), WHOLE)
    (one,) = joined()
    assert (one.name, one.parts) == ("0000", ())
    assert one.frames == (*range(10), 12, 13, *range(25, 33))
    assert one.points == (80,) * 20


def test_a_break_of_the_sensor_s_way_is_not_joined_across(drive):
    add, joined = drive
    add(range(10), LEFT)
    add(range(25, 33), WHOLE)
    assert len(joined(breaks=(35,))) == 1
    assert [one.name for one in joined(breaks=(20,))] == ["0000", "0001"]


def test_cars_parked_beside_and_behind_each_other_stay_two(drive):
    add, joined = drive
    add(range(10), WHOLE)
    add(range(20, 30), WHOLE, at=lambda frame: (7.0, 7.3))
    add(range(20, 30), WHOLE, at=lambda frame: (12.2, 6.8))
    assert [one.name for one in joined()] == ["0000", "0001", "0002"]


def test_what_drives_through_the_place_is_another(drive):
    add, joined = drive
    add(range(10), WHOLE)
    add(range(20, 30), WHOLE, at=lambda frame: (8.0 + 0.8 * (frame - 25), 5.0))
    assert len(joined()) == 2


def test_what_is_seen_at_the_same_times_is_two_things(drive):
    add, joined = drive
    add(range(10), WHOLE)
    add(range(2, 12), LEFT)
    assert len(joined()) == 2


def test_a_chain_of_pieces_does_not_make_one_of_two_cars(drive):
    add, joined = drive
    for number in range(4):  # each half on the next, together 7.5 m long
        add(
            range(10 * number, 10 * number + 5),
            WHOLE,
            lambda frame: (8.0 + 1.1 * (frame // 10), 5.0),
            0.0,
        )
    assert len(joined()) == 2
