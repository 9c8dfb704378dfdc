# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sensor that jumps, one that stands, and objects in place of scans."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.drives.street import HEIGHT, scan, street
from tests.refusal import refused

import wildshape
from wildshape.drives.config import DriveConfig, LinkConfig, MountingConfig
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.drives.source import Drive
from wildshape.drives.tracking.mounting import Mounting, find_mounting
from wildshape.drives.tracking.trajectory import Breaks, find_trajectory
from wildshape.drives.writing.files import DriveFiles
from wildshape.geometry.transforms.rotation import rotation_z
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.folders.box_files import BoxFiles
from wildshape.records import Turn
from wildshape.simulate.shapes.solid import box, cylinder
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

pytest.importorskip("kiss_icp")
pytest.importorskip("pypatchworkpp")

LEVEL = Mounting(1.7, 0.0, (0.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def scans():
    return street(frames=4).scans


def drive_of(scans):
    names = [f"{frame:06d}" for frame in range(len(scans))]
    return Drive.of("street", names, lambda frame: Turn(scans[frame]))


def test_the_way_breaks_off_where_a_scan_was_taken_elsewhere(scans):
    far = np.array((30.0, 0.0, 0.0), np.float32)
    jumped = [*scans[:2], *(scan + far for scan in scans[2:])]
    way = find_trajectory(drive_of(jumped), LEVEL, DriveConfig())
    assert way.breaks.frames == (2,)
    (told,) = way.breaks.told()
    assert "breaks off 1 time, first at frame 2" in told
    steps = np.linalg.norm(np.diff(way.T_world_sensor.translation.numpy(), axis=0), axis=1)
    assert steps[1] == pytest.approx(steps[0])  # it goes on as it went before
    assert Breaks((2,)).ticks((0, 1, 2, 3), LinkConfig(longest_gap=4)) == [0, 1, 7, 8]


@pytest.mark.parametrize("frame", [0, 2])
def test_the_way_goes_on_after_a_scan_that_lost_most_packets(scans, frame):
    """On it lies little of the next one, which was taken for one from elsewhere."""
    left = scans[frame][np.arctan2(scans[frame][:, 1], scans[frame][:, 0]) > 1.5]
    way = find_trajectory(
        drive_of([*scans[:frame], left, *scans[frame + 1 :]]), LEVEL, DriveConfig()
    )
    assert way.breaks.frames == ()
    steps = np.diff(way.T_world_sensor.translation.numpy(), axis=0)
    assert steps == pytest.approx(np.tile((0.7, 0.02, 0.0), (3, 1)), abs=0.1)


def test_a_sensor_that_stands_stays_where_it_is(scans):
    way = find_trajectory(drive_of([scans[0]] * 3), LEVEL, DriveConfig())
    assert (way.breaks.frames, way.breaks.told()) == ((), [])
    assert way.T_world_sensor.translation.abs().max() < 0.01


@pytest.mark.parametrize("looks_deg", [0, 135])
def test_a_recording_that_begins_at_speed_is_followed(looks_deg):
    """At 33 m/s a step is 3.3 m: from where the sensor stood before nothing near fits."""
    drive = WholeDrive(StreetConfig(scans=4, sensor="hdl32", speed=33.0, compensated=True), seed=1)
    made = [drive.scan(frame) for frame in range(4)]
    turn = rotation_z(torch.tensor(math.radians(looks_deg), dtype=torch.float64))
    T_looking_sensor = SE3(turn, torch.zeros(3, dtype=torch.float64))
    scans = [T_looking_sensor.apply_numpy(scan.points) for scan in made]
    way = find_trajectory(drive_of(scans), replace(LEVEL, height_m=1.84), DriveConfig())
    places = np.stack([scan.T_world_sensor[:3, 3] for scan in made])
    found = np.linalg.norm(np.diff(way.T_world_sensor.translation.numpy(), axis=0), axis=1)
    assert found == pytest.approx(np.linalg.norm(np.diff(places, axis=0), axis=1), abs=0.3)
    assert way.breaks.frames == ()


def test_a_sensor_that_may_drive_though_it_seems_to_stand_is_said(scans):
    """Between plain walls, in traffic as fast as itself, the odometry went 0 of 14 m."""
    road = box((-80.0, -80.0, -HEIGHT - 0.5), (120.0, 80.0, -HEIGHT))
    walls = [box((-80.0, y, -HEIGHT), (120.0, y + 1.0, 5.0)) for y in (7.0, -8.0)]
    poles = [
        cylinder(np.array((x, y, -HEIGHT)), np.array((x, y, 3.0)), (0.12, 0.12), 8)
        for x in range(-60, 100, 12)
        for y in (5.0, -5.0)
    ]
    seen = []
    for frame in range(8):
        at = 2.0 * frame
        places = ((8.0, -0.9), (-12.0, -0.9), (3.0, -4.4), (-7.0, 2.6), (15.0, 2.6))
        cars = [box((at + x, y, -HEIGHT), (at + x + 4.3, y + 1.8, 1.5 - HEIGHT)) for x, y in places]
        seen.append(scan([road, *walls, *poles, *cars], (at, 0.0), frame))
    (told,) = find_trajectory(drive_of(seen), LEVEL, DriveConfig()).breaks.told()
    assert "taken to stand, but its first scans also fit a way ahead" in told
    assert find_trajectory(drive_of([scans[0]] * 8), LEVEL, DriveConfig()).breaks.told() == []


def test_a_flat_ceiling_does_not_hold_the_sensor_back():
    """Its rings lie around the sensor wherever it is: in a car park it stood still."""
    up = np.deg2rad(np.arange(2.0, 22.5, 0.35))
    around = np.deg2rad(np.arange(0, 360, 0.4))
    e, a = (grid.ravel() for grid in np.meshgrid(up, around, indexing="ij"))
    rays = np.column_stack((np.cos(a), np.sin(a), np.tan(e)))
    noise = np.random.default_rng(0).normal(scale=0.01, size=(5, len(e), 1))
    rings = (rays * (0.8 / np.tan(e)[:, None] + noise)).astype(np.float32)
    low = [scan[scan[:, 2] < 0.8] for scan in street(frames=5).scans]
    under = [np.concatenate(both) for both in zip(low, rings)]
    way = find_trajectory(drive_of(under), LEVEL, DriveConfig())
    found = way.T_world_sensor.translation[-1].numpy()
    assert found == pytest.approx((4 * 0.7, 4 * 0.02, 0.0), abs=0.1)


def test_scans_of_objects_are_refused(scans):
    car = [scan[(np.abs(scan - (9, -4, -1)) < (3, 2, 1.2)).all(1)] for scan in scans]
    refused(find_mounting, drive_of(car), MountingConfig(), match="single objects, cut out")
    assert find_mounting(drive_of(scans), MountingConfig()).height_m == pytest.approx(1.7, abs=0.05)


def test_a_sensor_upside_down_is_refused_and_a_tilted_one_is_not(scans, tmp_path):
    config = MountingConfig()
    hanging = [scan * np.array((1, -1, -1), np.float32) for scan in scans]
    refused(find_mounting, drive_of(hanging), config, match="hung upside down; turn the scans")
    np.save(tmp_path / "0.npy", hanging[0])
    refused(wildshape.drive, tmp_path, tmp_path / "out", match="hung upside down")
    assert not (tmp_path / "out").exists()  # so that it may be begun with mended scans
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    turn = np.array(((c, 0, s), (0, 1, 0), (-s, 0, c)), np.float32)
    tilted = find_mounting(drive_of([scan @ turn.T for scan in scans]), config)
    assert tilted.tilt_deg == pytest.approx(20, abs=0.5)


def test_a_sensor_under_a_low_ceiling_does_not_hang():
    """Of 16 beams more meet the ceiling than the floor: a car park was refused as upside down."""
    rng = np.random.default_rng(0)
    floor, ceiling, cars = rng.uniform(-14.0, 14.0, (3, 8000, 3)).astype(np.float32)
    floor[:, 2], ceiling[:, 2] = -1.7, 0.5
    cars[:, 2] = rng.uniform(-1.5, 0.0, size=len(cars))
    scan = np.concatenate((floor[:2500], ceiling, cars[np.abs(cars[:, 1]) > 5]))
    scan += rng.normal(scale=0.01, size=scan.shape).astype(np.float32)
    found = find_mounting(drive_of([scan]), MountingConfig())
    assert found.height_m == pytest.approx(1.7, abs=0.05)
    assert 0.1 < found.ground < 0.2


def test_scans_in_the_frame_of_a_vehicle_are_said(scans):
    """Its origin lies on the road: what a ray passed is not what the sensor looked through."""
    of_vehicle = [scan + np.array((1.0, 0.0, 1.7), np.float32) for scan in scans]
    (told,) = find_mounting(drive_of(of_vehicle), MountingConfig()).told()
    assert "give scans as the sensor saw them" in told
    assert find_mounting(drive_of(scans), MountingConfig()).told() == []


def test_scans_without_their_ground_and_scans_in_feet_are_said(scans):
    bare = [scan[scan[:, 2] > -1.6] for scan in scans]
    (told,) = find_mounting(drive_of(bare), MountingConfig()).told()
    assert "hardly any ground is seen, 4 % of the points" in told
    feet = [scan / np.float32(0.3048) for scan in scans]
    (told,) = find_mounting(drive_of(feet), MountingConfig()).told()
    assert "5.6 m below the sensor, higher than on any vehicle" in told


def test_ground_that_was_cut_off_at_a_height_is_said():
    """What is lowest of vehicles and pavements passes for ground: boxes were 0.27 m too high."""
    rng = np.random.default_rng(0)
    whole = []
    for _ in range(4):
        road, walls, verge = rng.uniform(-14.0, 14.0, (3, 30_000, 3)).astype(np.float32)
        road[:, 2] = -1.7 - 0.001 * road[:, 1] ** 2 + rng.normal(scale=0.02, size=len(road))
        verge[:, 2] = -1.5 + rng.normal(scale=0.03, size=len(verge))
        walls[:, 1:] = np.abs(walls[:, 1:]) / (200.0, 4.0) + (9.0, -1.8)
        road = road[np.hypot(road[:, 0], road[:, 1]) > 3]
        whole.append(np.concatenate((road, walls, verge[verge[:, 1] > 6])))
    for cut, told in ((-1.65, 1), (-1.55, 1), (-2.1, 0), (-9.0, 0)):
        scans = [scan[scan[:, 2] > cut] for scan in whole]
        found = find_mounting(drive_of(scans), MountingConfig()).told()
        assert len(found) == told
        assert all(f"lower than {-cut:.2f} m below the sensor" in one for one in found)


def test_ground_that_most_of_was_taken_away_is_said():
    found = Mounting(1.4, 0.0, (0.0, 0.0, 1.0), ground=0.1, spread_m=0.5)
    (told,) = found.told()
    assert "differs by 0.5 m from scan to scan" in told
    assert replace(found, spread_m=0.03).told() == []


def test_lost_packets_are_said_and_a_sensor_that_looks_ahead_is_not(scans):
    azimuths = [np.rad2deg(np.arctan2(scan[:, 1], scan[:, 0])) for scan in scans]
    lossy = [scan[azimuth // 2.4 % 2 == 0] for scan, azimuth in zip(scans, azimuths)]
    (told,) = find_mounting(drive_of(lossy), MountingConfig()).told()
    assert "75 gaps around the sensor in which nothing is seen, as if packets were lost" in told
    ahead = [scan[abs(azimuth) < 60] for scan, azimuth in zip(scans, azimuths)]
    coarse = [scan[np.rint(azimuth / 0.3) % 2 == 0] for scan, azimuth in zip(scans, azimuths)]
    assert find_mounting(drive_of(ahead), MountingConfig()).told() == []
    assert find_mounting(drive_of(coarse), MountingConfig()).told() == []


def test_scans_in_one_common_frame_are_said():
    seen = street(frames=5, speed=6.0)
    places = np.column_stack((seen.places, np.zeros(5))).astype(np.float32)
    common = [scan + place for scan, place in zip(seen.scans, places)]
    (told,) = find_mounting(drive_of(common), MountingConfig()).told()
    assert "one common frame" in told
    assert find_mounting(drive_of(seen.scans), MountingConfig()).told() == []


def test_scans_of_no_finite_point_are_refused_as_that(tmp_path):
    for frame in range(2):
        np.save(tmp_path / f"{frame}.npy", np.full((500, 3), np.nan, np.float32))
    refused(find_mounting, open_drive(tmp_path), MountingConfig(), match="all of them are NaN")


@pytest.mark.parametrize("pause", [600.0, 86_400.0, 1.7e9])
def test_a_sensor_that_stands_stays_over_a_pause_and_when_its_clock_is_set(pause):
    """However long: the noise of the speed is not taken times the pause."""
    street = WholeDrive(StreetConfig(scans=6, sensor="hdl32", speed=0.0, compensated=True), 3)
    seen = [street.scan(frame).points for frame in range(6)]
    times = [0.1 * frame + pause * (frame > 2) for frame in range(6)]
    names = [f"{frame:06d}" for frame in range(6)]
    drive = Drive.of("street", names, lambda frame: Turn(seen[frame]), times)
    way = find_trajectory(drive, find_mounting(drive, MountingConfig()), DriveConfig())
    assert way.breaks.frames == ()
    assert way.T_world_sensor.translation.abs().max() < 0.05


def test_the_scans_beside_a_pause_are_corrected_by_the_motion_on_their_own_side():
    names = [f"{frame:06d}" for frame in range(6)]
    times = [0.0, 0.1, 0.2, 100.0, 100.1, 100.2]
    places = torch.tensor([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]).double()
    path = SE3(torch.eye(3).double().expand(6, 3, 3), places[:, None] * torch.eye(3).double()[0])
    drive = Drive.of("street", names, lambda _: Turn(np.zeros((1, 3), np.float32)), times)
    motion = drive.moved_by(path).motion
    assert motion is not None
    assert [twist.linear[0] for twist in motion] == pytest.approx([10.0] * 6)


def test_a_drive_without_vehicles_has_an_empty_file_of_labels(tmp_path):
    """Evaluations of KITTI tracking ask for a file of each drive."""
    road = box((-60.0, -60.0, -HEIGHT - 0.5), (60.0, 60.0, -HEIGHT))
    kerbs = [box((-60.0, y, -HEIGHT), (60.0, y + 0.5, 0.5)) for y in (9.0, -9.5)]
    (tmp_path / "bare").mkdir()
    for frame in range(4):
        np.save(tmp_path / "bare" / f"{frame}.npy", scan([road, *kerbs], (0.0, 0.0), frame))
    files = DriveFiles(BoxFiles(("kitti",)))
    found = wildshape.drive(tmp_path / "bare", tmp_path / "out", files=files)
    assert found.vehicles == ()
    assert (found.out / "boxes" / "kitti" / "bare.txt").read_bytes() == b""
