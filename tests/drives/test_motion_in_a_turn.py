# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scans whose points have times are corrected for the sensor's motion during the turn."""

from dataclasses import replace

import numpy as np
import pytest

from wildshape.drives.config import DriveConfig
from wildshape.drives.source import Drive
from wildshape.drives.tracking.mounting import find_mounting
from wildshape.drives.tracking.segmentation import Cutter, read_cut
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.trajectory import find_trajectory
from wildshape.records import Turn
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")

CONFIG = DriveConfig()
SCANS = 6


@pytest.fixture(scope="module")
def simulated():
    """Scans as measured from a fast vehicle, and as seen from one place a scan."""
    street = WholeDrive(StreetConfig(scans=SCANS, sensor="hdl32", speed=15.0), 3)
    scans = [street.scan(frame) for frame in range(SCANS)]
    return scans, [seen_from_one_place(scan, street) for scan in scans]


def seen_from_one_place(scan, street):
    columns, column = np.unique(scan.times, return_inverse=True)
    T = np.linalg.inv(scan.T_world_sensor) @ street.sensor_pose(scan.time + columns)
    return np.einsum("nij,nj->ni", T[column, :3, :3], scan.points) + T[column, :3, 3]


def drive_of(scans, *, timed):
    known = [timed and len(scan.points) for scan in scans]  # an empty file tells no times
    turns = [Turn(scan.points, scan.times if known[i] else None) for i, scan in enumerate(scans)]
    names = [f"{frame:06d}" for frame in range(len(scans))]
    return Drive.of("street", names, turns.__getitem__, [scan.time for scan in scans])


def followed(scans, *, timed):
    """The drive, corrected as far as it can be, and how far each step is off, metres."""
    drive = drive_of(scans, timed=timed)
    way = find_trajectory(drive, find_mounting(drive, CONFIG.mounting), CONFIG)
    assert way.breaks.frames == ()
    found = way.T_world_sensor
    true = np.stack([scan.T_world_sensor for scan in scans])
    steps = np.linalg.inv(true[:-1]) @ true[1:]
    walked = (found[slice(0, -1)].inverse() @ found[slice(1, None)]).matrix.numpy()
    return drive.moved_by(found), np.linalg.norm((walked - steps)[:, :3, 3], axis=1).mean()


def test_points_are_where_one_place_sees_them_and_the_way_is_truer(simulated):
    measured, compensated = simulated
    corrected, off = followed(measured, timed=True)
    as_it_is, off_without = followed(measured, timed=False)
    for frame, true in enumerate(compensated):
        assert np.linalg.norm(corrected.scan(frame) - true, axis=1).mean() < 0.03
        assert np.linalg.norm(as_it_is.scan(frame) - true, axis=1).mean() > 0.2
    assert off < 0.9 * off_without


def test_objects_know_when_their_points_were_met(simulated, tmp_path):
    measured, _ = simulated
    for timed in (True, False, "moved"):
        drive = drive_of(measured, timed=bool(timed))
        if timed == "moved":  # by the data set
            drive = replace(drive, read=lambda i: Turn(measured[i].points, met=measured[i].times))
        cuts = tmp_path / str(timed)
        cuts.mkdir()
        Cutter(drive, find_mounting(drive, CONFIG.mounting), cuts, CONFIG)(2)
        cut = read_cut(cuts, 2)
        seen = Sightings("a", (2,), ((1,),), (int(cut.counts[1]),))
        (seconds,) = seen.seconds(cuts)
        true = measured[2].times[cut.rows_of([1])] if timed else np.empty(0)
        np.testing.assert_allclose(seconds, true, atol=1e-7)


@pytest.mark.parametrize("stamped_s", [-0.05, 0.0, 0.05])
def test_the_way_is_as_true_where_a_scan_is_stamped_at_its_first_or_last_point(stamped_s):
    """About the first point an error of the speed came back in the next step, turned round."""
    street = WholeDrive(StreetConfig(scans=40, sensor="hdl32", speed=10.0), 3)
    scans = [street.scan(frame) for frame in range(40)]

    turns = [Turn(scan.points, scan.times - stamped_s) for scan in scans]
    at = [scan.time + stamped_s for scan in scans]
    names = [f"{frame:06d}" for frame in range(40)]
    drive = Drive.of("street", names, turns.__getitem__, at)
    way = find_trajectory(drive, find_mounting(drive, CONFIG.mounting), CONFIG)
    assert way.breaks.frames == ()
    true = np.stack([street.sensor_pose(np.array([time]))[0] for time in at])
    true = np.linalg.inv(true[0]) @ true
    off = np.abs(way.T_world_sensor.matrix.numpy() - true)[:, :3, 3]
    assert off.max() < 0.08  # of 40 m; the sensor sways within a turn


def test_the_way_is_as_true_where_the_first_scan_is_empty(simulated):
    """The motion before the scans after it is found as that before a first one with points."""
    measured, _ = simulated
    nothing = replace(measured[0], points=measured[0].points[:0], times=measured[0].times[:0])
    _, off = followed(measured, timed=True)
    _, off_behind = followed([nothing, *measured[1:]], timed=True)
    assert off_behind < 2 * off


@pytest.mark.parametrize("timed", [False, True])
def test_the_way_is_as_true_where_most_scans_are_empty(timed):
    """As if they were missing: the step over them was taken for that of one scan."""
    street = WholeDrive(StreetConfig(scans=13, sensor="hdl32", speed=6.0), 3)
    scans = [street.scan(frame) for frame in range(13)]
    none = Turn(np.empty((0, 3), np.float32))
    every = drive_of(scans, timed=timed)
    drive = replace(every, read=lambda frame: none if frame % 3 else every.read(frame))
    way = find_trajectory(drive, find_mounting(drive, CONFIG.mounting), CONFIG)
    true = np.stack([scan.T_world_sensor for scan in scans])
    off = way.T_world_sensor.matrix.numpy() - np.linalg.inv(true[0]) @ true
    assert way.breaks.frames == ()
    assert np.linalg.norm(off[3:, :3, 3], axis=1).max() < 0.3  # of the first step nothing is known


@pytest.mark.parametrize(("stamped_s", "timed_s"), [(0.0999, 0.0), (0.0, 0.1)])
def test_a_scan_that_is_late_does_not_make_the_sensor_race(simulated, stamped_s, timed_s):
    """By its stamp, or by the times of its points: the next one seems to come at once."""
    measured, _ = simulated
    late = [float(frame == 2) for frame in range(SCANS)]
    turns = [Turn(scan.points, scan.times + timed_s * late[i]) for i, scan in enumerate(measured)]
    times = [scan.time + stamped_s * late[i] for i, scan in enumerate(measured)]
    names = [f"{frame:06d}" for frame in range(SCANS)]
    drive = Drive.of("street", names, turns.__getitem__, times)
    way = find_trajectory(drive, find_mounting(drive, CONFIG.mounting), CONFIG)
    assert way.breaks.frames == ()
    assert way.T_world_sensor.translation.abs().max() < 1.2 * 15.0 * 0.1 * SCANS


def test_scans_whose_times_cannot_be_used_are_told_of(simulated):
    measured, _ = simulated

    def told(timed_frames):
        turns = [
            Turn(s.points, s.times if i in timed_frames else None) for i, s in enumerate(measured)
        ]
        names = [f"{frame:06d}" for frame in range(SCANS)]
        times = [scan.time for scan in measured]
        drive = Drive.of("street", names, turns.__getitem__, times)
        return find_trajectory(drive, find_mounting(drive, CONFIG.mounting), CONFIG).breaks.told()

    assert told(range(SCANS)) == told(()) == []
    (sentence,) = told((0, 1, 3, 5))
    assert "in 2 scans, first of frame 2" in sentence
