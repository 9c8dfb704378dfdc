# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of ROS: every scan comes back exactly; what is cut off is read up to there."""

import pickle
import shutil
import sqlite3
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.cli.main import main
from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.errors import MissingExtraError
from wildshape.io.bags.clouds import cloud_of, message_types
from wildshape.io.bags.reader import open_bag
from wildshape.io.bags.storages import CLOUD, unpacked

pytest.importorskip("rosbags")
pytest.importorskip("mcap")

from mcap.writer import CompressionType, Writer
from tests.io.bags.write import KINDS, Fields, cloud, write_bag

TOPIC = "/velodyne_points"
every_kind = pytest.mark.parametrize("kind", KINDS)


def scans(count=6, points=2000):
    rng = np.random.default_rng(0)
    return [rng.normal(0, 10, (points, 3)).astype(np.float32) for _ in range(count)]


@pytest.fixture
def written(tmp_path):
    return partial(write_bag, tmp_path / "recording")


@every_kind
@pytest.mark.parametrize("packed", [False, True, "messages"])
def test_every_scan_comes_back_in_time(written, kind, packed):
    path = written(kind, {TOPIC: scans()}, packed=packed, extra=["/notes"])
    (path.parent / f"._{path.name}").write_bytes(b"left by macOS")
    for source in (path, path if kind == "bag" else path.parent):
        drive = open_drive(source)
        assert (drive.name, len(drive), drive.ticks) == ("recording", 6, tuple(range(6)))
        assert drive.warnings == ()
        assert drive.times == pytest.approx(1e9 + np.arange(6) / 10, abs=1e-6)
        for frame in (5, 0, 3, 1, 2, 4):  # in any order
            assert np.array_equal(drive.scan(frame), scans()[frame])
        again = pickle.loads(pickle.dumps(drive))  # as other processes get it
        assert np.array_equal(again.scan(4), scans()[4])


@every_kind
def test_a_suffix_in_capitals_is_the_same_suffix(written, kind):
    path = written(kind, {TOPIC: scans()})
    loud = path.rename(path.with_suffix(path.suffix.upper()))
    for source in (loud, loud if kind == "bag" else loud.parent):
        assert np.array_equal(open_drive(source).scan(4), scans()[4])


@every_kind
@pytest.mark.parametrize("fields", [Fields("f8"), Fields("f4", big=True), Fields("i2", rows=4)])
def test_fields_are_found_by_name_type_and_order_of_bytes(written, kind, fields):
    whole = [np.rint(scan) for scan in scans(2)] if fields.kind == "i2" else scans(2)
    drive = open_drive(written(kind, {TOPIC: whole}, fields))
    measured = [scan[(scan != 0).any(1)] for scan in whole]
    assert all(np.array_equal(drive.scan(frame), measured[frame]) for frame in range(2))


@every_kind
def test_points_without_a_return_are_left_out_and_counted(written, kind):
    first, second = scans(2)
    first[:3] = np.nan
    second[5], second[6, 1] = 0, np.inf
    drive = open_drive(written(kind, {TOPIC: [first, second]}))
    assert np.array_equal(drive.scan(0), first[3:])
    assert np.array_equal(drive.scan(1), np.delete(second, (5, 6), 0))
    assert drive.warnings == ("5 points without a return left out",)


CLOCKS = {
    "t": ("u4", 1e9, 0.0),  # Ouster
    "offset_time": ("u4", 1e6, 0.0),
    "time": ("f4", 1.0, 0.0),  # Velodyne
    "timestamp": ("f8", 1.0, 1e9),  # Hesai: the stamp's clock
    "time_stamp": ("f8", 1.0, 1e9 - 0.05),  # the same, stamped in the turn's middle
    "gps_time": ("f8", 1e9, 4e5),  # another clock: its first point is the scan's time
}


@pytest.mark.parametrize("name", CLOCKS)
def test_times_of_points_are_seconds_since_the_scan_s_time(written, name):
    kind, unit, start = CLOCKS[name]
    since = np.linspace(0.0, 0.1, 2000)
    recorded = [(start + since + frame / 10 * (start > 1e8)) * unit for frame in range(2)]
    drive = open_drive(
        written("mcap", {TOPIC: scans(2)}, Fields(clock=(name, kind)), times=recorded)
    )
    for frame in range(2):
        turn = drive.turn(frame)
        first = start - 1e9 if start > 1e8 else 0.0
        assert turn.seconds == pytest.approx(since + first, abs=2e-6)
        assert np.array_equal(turn.points, scans()[frame])


def test_times_that_tell_of_no_turn_are_left_alone(written):
    never = [np.zeros(2000), np.linspace(0, 2e9, 2000), np.full(2000, np.nan)]
    drive = open_drive(written("bag", {TOPIC: scans(3)}, Fields(clock=("t", "f8")), times=never))
    assert [drive.turn(frame).seconds for frame in range(3)] == [None] * 3
    (told,) = drive.warnings
    assert told.startswith("times of points cannot be used: from 0 to 0 is no turn; scans are not")


def test_a_field_that_is_not_read_as_times_is_named(written):
    since = [np.linspace(0.0, 0.1, 2000)] * 3
    drive = open_drive(written("bag", {TOPIC: scans(3)}, Fields(clock=("ts", "f8")), times=since))
    (told,) = drive.warnings
    assert told.startswith("the field ts is not read as times of points: name it `time`; scans")


@every_kind
def test_an_empty_scan_is_a_scan(written, kind):
    one, other = scans(2)
    drive = open_drive(written(kind, {TOPIC: [one, one[:0], other]}))
    assert [len(drive.scan(frame)) for frame in range(3)] == [2000, 0, 2000]


@every_kind
def test_scans_that_are_copies_of_the_ones_before_are_said(written, kind):
    """A driver that hangs sends them under new stamps; of folders that was said."""
    one, other = scans(2)
    nothing = one[:0]
    (told,) = open_drive(written(kind, {TOPIC: [one, other, other, nothing, nothing]})).warnings
    assert told == "1 scan equal to the one before, to the last bit; the first: frame 2"


@every_kind
def test_of_two_sensors_in_a_topic_the_one_with_most_scans_is_taken(written, kind):
    """Each in its own frame: no way was found through them."""
    frames = ["left", "right", "left", "left", "right", "left"]
    drive = open_drive(written(kind, {TOPIC: scans()}, frames=frames))
    assert [np.array_equal(drive.scan(i), scans()[j]) for i, j in enumerate((0, 2, 3, 5))] == [
        True
    ] * 4
    assert drive.warnings[0] == (
        f"{TOPIC} holds scans in 2 frames; those in left were taken, which are most, and those in"
        " right left out"
    )


def test_a_frame_that_got_another_name_on_the_way_is_one_sensor_s(written):
    drive = open_drive(written("mcap", {TOPIC: scans()}, frames=["", *["lidar"] * 5]))
    assert (len(drive), drive.warnings) == (6, ())


@every_kind
def test_stamps_of_the_scans_are_their_order(written, kind):
    stamps = [3 * 10**8, 10**8, 2 * 10**8, 2 * 10**8]
    drive = open_drive(written(kind, {TOPIC: scans(4)}, stamps=stamps))
    assert drive.times == (0.1, 0.2, 0.3)
    assert [np.array_equal(drive.scan(i), scans(4)[j]) for i, j in enumerate((1, 2, 0))] == [
        True
    ] * 3
    assert drive.warnings == ("1 scan with the time of another left out",)


@every_kind
def test_where_a_clock_was_set_back_the_time_of_recording_counts(written, kind):
    """Sorted by their stamps scans were shuffled, and no way was found through them."""
    stamps = [10**18 + frame * 10**8 - 4 * 10**8 * (frame >= 4) for frame in range(8)]
    drive = open_drive(written(kind, {TOPIC: scans(8)}, stamps=stamps))
    assert drive.times == pytest.approx(1e9 + np.arange(8) / 10, abs=1e-6)
    assert all(np.array_equal(drive.scan(i), scans(8)[i]) for i in range(8))
    (told,) = drive.warnings
    assert told.startswith(f"the stamps of {TOPIC} fall by 0.4 s between scans")


@every_kind
def test_where_a_clock_was_set_forward_no_scans_are_missing(written, kind):
    """A sensor's clock that found its master on the way: 36,000 scans were said to be missing."""
    stamps = [10**18 + frame * 10**8 + 3600 * 10**9 * (frame >= 4) for frame in range(8)]
    drive = open_drive(written(kind, {TOPIC: scans(8)}, stamps=stamps))
    assert drive.times == pytest.approx(1e9 + np.arange(8) / 10, abs=1e-6)
    assert drive.ticks == tuple(range(8))
    (told,) = drive.warnings
    assert told.startswith(f"the stamps of {TOPIC} rise by 3.6e+03 s between scans")


@every_kind
def test_stamps_after_a_pause_or_before_a_recorder_s_lag_stay(written, kind):
    lag = [10**18 + frame * 10**8 + 10**9 * (frame >= 4) for frame in range(8)]
    times = open_drive(written(kind, {TOPIC: scans(8)}, stamps=lag)).times
    assert times is not None
    assert times[-1] == 1e9 + 1.7


@every_kind
def test_a_scan_that_was_recorded_late_stays_where_its_stamp_says(written, kind):
    order = [0, 1, 2, 4, 3, 5, 6, 7]
    stamps = [10**18 + at * 10**8 for at in order]
    drive = open_drive(written(kind, {TOPIC: scans(8)}, stamps=stamps))
    assert drive.warnings == ()
    assert all(np.array_equal(drive.scan(at), scans(8)[i]) for i, at in enumerate(order))


@every_kind
def test_without_stamps_the_time_of_recording_counts(written, kind):
    drive = open_drive(written(kind, {TOPIC: scans(3)}, stamps=[0, 0, 0]))
    assert drive.times == pytest.approx(1e9 + np.arange(3) / 10, abs=1e-6)


@every_kind
def test_of_several_topics_one_is_chosen(written, kind):
    front, back = scans(2), [scan + 1 for scan in scans(3)]
    path = written(kind, {"/front": front, "/back": back}, extra=["/notes"])
    refused(open_drive, path, match="choose one of its topics with --topic: /back, /front")
    assert len(open_drive(path, "/back")) == 3
    assert np.array_equal(open_drive(path, "/front").scan(1), front[1])
    for topic in ("/middle", "/notes"):
        refused(open_drive, path, topic, match=f"no topic {topic} of point .* are /back, /front")


@every_kind
def test_what_holds_no_scans_is_refused(written, kind, tmp_path):
    path = written(kind, {}, extra=["/notes"])
    refused(open_drive, path, match="no topic of sensor_msgs/msg/PointCloud2, found std_msgs")
    path.write_bytes(b"nothing of the kind" * 1000)
    refused(open_drive, path, match="cut off or damaged")
    path.write_bytes(b"")
    refused(open_drive, path, match="cut off or damaged|found nothing")
    (tmp_path / "folder").mkdir()
    np.save(tmp_path / "folder" / "000000.npy", scans(1)[0])
    refused(open_drive, tmp_path / "folder", "/topic", match="has no topics")


@every_kind
def test_points_without_x_y_z_are_refused_by_their_fields(written, kind):
    drive = open_drive(written(kind, {TOPIC: scans(1)}, Fields(names="uvw")))
    refused(drive.read, 0, match="the fields u, v, w, but no x, y, z")


@every_kind
@pytest.mark.parametrize("part", [0.3, 0.5, 0.8, 0.97])
def test_a_cut_recording_is_read_up_to_there(written, kind, part):
    """No scan is changed: those that are read are whole."""
    recorded = scans(100, 3000)
    path = written(kind, {TOPIC: recorded})
    whole = path.read_bytes()
    path.write_bytes(whole[: int(part * len(whole))])
    drive = open_drive(path)
    assert 100 * (part - 0.2) < len(drive) <= 100
    for frame in range(len(drive)):
        assert np.array_equal(drive.scan(frame), recorded[frame])
    (told,) = drive.warnings
    assert "is cut off or damaged" in told
    assert told.endswith(f"; {len(drive)} scans could be read")


@contextmanager
def recorder(path, rows):
    """A recorder in WAL mode: `rows` of what it wrote lie beside its file, which is not closed."""
    with closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode=WAL")
        last = "SELECT * FROM messages ORDER BY id DESC LIMIT ?"
        kept = database.execute(last, (rows,)).fetchall()
        database.executemany("DELETE FROM messages WHERE id = ?", [row[:1] for row in kept])
        database.commit()
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        places = ", ".join("?" * len(kept[0]))
        database.executemany(f"INSERT INTO messages VALUES ({places})", kept)
        database.commit()
        yield


def test_messages_in_a_log_beside_the_file_are_said_to_be_there(written, tmp_path):
    path = written("db3", {TOPIC: scans()})
    with recorder(path, rows=2):
        crashed = shutil.copytree(path.parent, tmp_path / "crashed")
    before = {file.name: file.read_bytes() for file in crashed.iterdir()}
    drive = open_drive(crashed)
    assert len(drive) == 4
    (told,) = drive.warnings
    assert "sqlite3 recording.db3 'PRAGMA wal_checkpoint(TRUNCATE)' moves them" in told
    assert told.endswith("; 4 scans could be read")
    assert {file.name: file.read_bytes() for file in crashed.iterdir()} == before
    with closing(sqlite3.connect(crashed / path.name)) as database:
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    drive = open_drive(crashed)
    assert (len(drive), drive.warnings) == (6, ())


def test_where_all_messages_are_beside_the_file_that_is_an_error(written, tmp_path):
    path = written("db3", {TOPIC: scans()})
    with recorder(path, rows=6):
        shutil.copytree(path.parent, tmp_path / "crashed")
    refused(open_drive, tmp_path / "crashed", match=r"-wal file: .*; /velodyne_points holds no")
    (tmp_path / "crashed" / path.name).write_bytes(b"")  # not even the tables are in it
    refused(open_drive, tmp_path / "crashed", match="-wal file: sqlite3 recording.db3 'PRAGMA")


def test_a_chunk_that_is_not_as_it_was_written_is_damaged(tmp_path):
    """Where nothing is packed other points came out, and no word of it."""
    path = tmp_path / "recording.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, chunk_size=1)
        writer.start()
        kind = writer.register_schema(CLOUD, "ros2msg", b"")
        channel = writer.register_channel(TOPIC, "cdr", kind)
        for at, points in enumerate(scans(), 1):
            writer.add_message(channel, at * 10**8, bytes(cloud(points, at * 10**8)), at * 10**8)
        writer.finish()
    whole, point = path.read_bytes(), scans()[4][1000, :1].tobytes()
    assert open_drive(path).warnings == ()
    assert whole.count(point) == 1
    path.write_bytes(whole.replace(point, bytes(4)))
    drive = open_drive(path)
    assert len(drive) == 4
    (told,) = drive.warnings
    assert "recording.mcap is cut off or damaged (crc" in told


def test_a_file_that_is_packed_as_a_whole_is_refused(written):
    """One of several was not missed."""
    path = written("db3", {TOPIC: scans()})
    packed = path.with_name("recording_1.db3.zstd")
    packed.write_bytes(b"")
    for source in (path.parent, packed):
        refused(open_drive, source, match="unpack it: unzstd recording_1.db3.zstd")
    path.rename(path.with_name("recording_1.db3"))  # `unzstd` keeps what it unpacks
    assert len(open_drive(path.parent)) == 6


def test_a_missing_library_is_named(written, monkeypatch):
    path = written("mcap", {TOPIC: scans(1)})
    monkeypatch.setitem(__import__("sys").modules, "mcap.stream_reader", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'wildshape\[bags\]'"):
        open_bag(path)


def test_the_command_line_lists_the_topics(written, tmp_path, capsys):
    path = written("bag", {"/front": scans(1), "/back": scans(1)})
    with pytest.raises(SystemExit, match="2"):
        main(["drive", str(path), "--out", str(tmp_path / "out")])
    assert "choose one of its topics with --topic: /back, /front" in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["lz4", "zstd", "bz2"])
def test_no_more_is_unpacked_than_a_recording_says(kind, tmp_path):
    module = {"lz4": "lz4.frame", "zstd": "zstandard", "bz2": "bz2"}[kind]
    zeros = bytes(8_000_000)
    packed = pytest.importorskip(module).compress(zeros)
    assert unpacked(tmp_path, kind, packed, 1000) == zeros[:1000]
    refused(unpacked, tmp_path, kind, packed, 1 << 32, match="unpack to 4294967296, which no scan")


def test_rows_of_a_cloud_do_not_overlap():
    types = message_types(True)
    said: Any = types.deserialize_cdr(cloud(scans(1)[0], 1), CLOUD)
    many: Any = replace(said, height=10_000_000, row_step=0)
    with pytest.raises(ValueError, match="rows of"):
        cloud_of(bytes(types.serialize_cdr(many, CLOUD)), cdr=True)


def test_a_field_that_ends_beyond_its_point_is_refused():
    types = message_types(True)
    said: Any = types.deserialize_cdr(cloud(scans(1)[0], 1), CLOUD)
    for offset in (said.point_step - 3, 2**31 - 1):
        fields = [replace(field, offset=offset) for field in said.fields]
        far: Any = replace(said, fields=fields)
        with pytest.raises(ValueError, match="a field that ends at"):
            cloud_of(bytes(types.serialize_cdr(far, CLOUD)), cdr=True)


def test_a_cloud_that_promises_more_than_64_bits_count_is_refused():
    types = message_types(True)
    said: Any = types.deserialize_cdr(cloud(scans(1)[0], 1), CLOUD)
    many: Any = replace(said, height=2**32 - 1, row_step=2**32 - 1)
    with pytest.raises(ValueError, match="where it promises"):
        cloud_of(bytes(types.serialize_cdr(many, CLOUD)), cdr=True)
