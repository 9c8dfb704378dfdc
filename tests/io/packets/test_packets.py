# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of packets: every turn comes back; what is cut off is read up to there."""

import pickle

import numpy as np
import pytest
from scipy.spatial import KDTree
from tests.refusal import refused

from wildshape.drives.recordings.recording_kinds import find_drives, open_drive
from wildshape.errors import MissingExtraError
from wildshape.io.packets.reader import open_packets
from wildshape.simulate.street.whole_drive import StreetConfig, WholeDrive

pytest.importorskip("velodyne_decoder")

import velodyne_decoder
from tests.io.packets.write import (
    PACKETS,
    PERIOD,
    hdl64e_ends,
    points_of,
    rewrite,
    seen_by,
    write_velodyne,
)


@pytest.fixture(scope="module")
def turns():
    """What a VLP-16 sees of a full scan, turned a little each time."""
    scan = WholeDrive(StreetConfig(scans=1, sensor="hdl32"), 1).scan(0).points.astype(np.float64)
    return [np.roll(seen_by(scan), 5 * number, axis=0) for number in range(3)]


@pytest.mark.parametrize("suffix", [".pcap", ".pcapng"])
def test_every_turn_of_a_velodyne_comes_back_in_time(turns, tmp_path, suffix):
    path = write_velodyne(tmp_path / f"street{suffix}", turns)
    assert find_drives(path) == ("packets of Velodyne or Ouster", [path])
    drive = pickle.loads(pickle.dumps(open_drive(path)))
    assert (drive.name, len(drive), drive.ticks, drive.warnings) == ("street", 3, (0, 1, 2), ())
    assert np.diff(drive.times) == pytest.approx(PERIOD, abs=1e-3)
    for frame in (2, 0, 1):  # in any order
        turn, true = drive.turn(frame), points_of(turns[frame])
        assert len(turn.points) == pytest.approx(len(true), rel=0.01)
        off, _ = KDTree(true).query(turn.points)
        # The decoder knows where in the head each laser sits, and how the head turns meanwhile.
        away = np.linalg.norm(turn.points, axis=1)
        assert (off < 0.02 + 0.004 * away).mean() > 0.99
        assert turn.seconds is not None
        assert -PERIOD <= turn.seconds.min() < turn.seconds.max() < 0.0015
        # The beam turns clockwise, from behind.
        around = np.arctan2(-turn.points[:, 1], turn.points[:, 0])
        assert np.corrcoef(around, turn.seconds)[0, 1] > 0.99


def test_turns_that_are_not_whole_are_left_out(turns, tmp_path):
    path = write_velodyne(tmp_path / "street.pcap", turns, turn_back=PACKETS // 2)
    assert len(open_drive(path)) == 2
    path = write_velodyne(tmp_path / "other.pcap", [*turns, turns[0][:20]])
    assert len(open_drive(path)) == 3


@pytest.mark.parametrize(
    ("begin", "count", "whole"),
    [
        (20, 20, 5),
        (PACKETS // 2, PACKETS, 4),  # two halves of different turns were taken for one
        (PACKETS // 2, 2 * PACKETS, 3),
    ],
)
def test_turns_amid_which_packets_are_missing(turns, tmp_path, begin, count, whole):
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 6)

    def lose(records):
        first = 2 * (2 * PACKETS + begin)
        del records[first : first + 2 * count]

    drive = open_drive(rewrite(path, lose))
    assert len(drive) == whole
    assert "1 turn with missing packets left out" in drive.warnings


def test_a_sensor_that_looks_back_alone_has_whole_turns(turns, tmp_path):
    """Nothing comes for half of each turn."""
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 4)

    def ahead(records):
        places = [number // 2 % PACKETS for number in range(len(records))]
        records[:] = [one for one, at in zip(records, places) if at < 19 or at >= 57]

    drive = open_drive(rewrite(path, ahead))
    assert (len(drive), drive.warnings) == (4, ())


def test_turns_of_another_mode_are_whole_too(turns, tmp_path):
    """From the middle on every second packet comes, as after a change to fewer returns."""
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 60)

    def thin(records):
        half = len(records) // 2
        later = [one for i, one in enumerate(records[half:]) if i % 4 < 2]
        records[:] = records[:half] + later

    drive = open_drive(rewrite(path, thin))
    assert len(drive) >= 50  # right after the change a turn has fewer than most around it


@pytest.mark.parametrize("place", [PACKETS + 30, 2 * PACKETS - 1])  # amid a turn, and at its end
def test_packets_that_overtook_each_other_begin_no_turn(turns, tmp_path, place):
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 4)

    def swap(records):
        one, other = records[2 * place + 1], records[2 * place + 3]
        one[1], other[1] = other[1], one[1]

    drive = open_drive(rewrite(path, swap))
    assert (len(drive), drive.warnings) == (4, ())
    assert len(drive.turn(1).points) == pytest.approx(len(points_of(turns[0])), rel=0.03)


@pytest.mark.parametrize(
    ("link", "header"),
    [
        (0, b"\x02\0\0\0"),
        (101, b""),
        (113, b"\0\0\0\1\0\6" + bytes(8) + b"\x08\0"),
        (276, b"\x08\0\0\0\0\0\0\2\0\1\0\6" + bytes(8)),
    ],
)
def test_packets_recorded_on_any_interface(turns, tmp_path, link, header):
    """As `tcpdump -i any` does; nothing was found in them."""
    path = write_velodyne(tmp_path / "street.pcap", turns)
    expected = open_drive(path).scan(1)

    def capture(records):
        for record in records:
            record[1] = header + record[1][14:]

    drive = open_drive(rewrite(path, capture, link))
    assert (len(drive), drive.warnings) == (3, ())
    assert np.array_equal(drive.scan(1), expected)


def test_packets_of_a_link_layer_that_is_not_read(turns, tmp_path):
    path = rewrite(write_velodyne(tmp_path / "street.pcap", turns), lambda _: None, 105)
    refused(open_drive, path, match="link layer 105 is not read; record from a network card")


def test_what_answers_and_cameras_send_ends_no_recording(turns, tmp_path):
    """Parts of packets in ICMP, and fragments, were taken for the end of the file."""
    path = write_velodyne(tmp_path / "street.pcap", turns)

    def add(records):
        stamp, sent = records[PACKETS]
        at, quoted = [1, 192, 168, 1, 77, 192, 168, 1, 201], sent[14:562]
        answer = bytes((0x45, 0, 2, 64, 0, 0, 0, 0, 64, *at[:1], 0, 0, *at[1:]))
        answer += b"\3\3" + bytes(6) + quoted
        fragment = bytes((0x45, 0, 1, 28, 0, 0, 0x20, 0, 64, 17, 0, 0, *at[1:]))
        fragment += b"\0\5\0\5\x20\0\0\0" + bytes(256)
        records[PACKETS:PACKETS] = [[stamp, sent[:14] + one] for one in (answer, fragment)]

    drive = open_drive(rewrite(path, add))
    assert (len(drive), drive.warnings) == (3, ())


def test_packets_that_were_recorded_twice_count_once(turns, tmp_path):
    path = write_velodyne(tmp_path / "street.pcap", turns)
    expected = open_drive(path).scan(1)

    def double(records):
        records[:] = [one for one in records for _ in range(2)]

    drive = open_drive(rewrite(path, double))
    assert (len(drive), drive.warnings) == (3, ())
    assert np.array_equal(drive.scan(1), expected)


def test_a_clock_that_was_set_back(turns, tmp_path):
    """All was refused, to be sorted."""
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 6)

    def set_back(records):
        for record in records[2 * PACKETS * 7 // 2 :]:
            record[0] -= 1.0

    drive = open_drive(rewrite(path, set_back))
    assert drive.times is not None
    assert np.diff(drive.times) == pytest.approx([PERIOD, PERIOD, 2 * PERIOD, PERIOD], abs=1e-3)
    assert "the clock of street.pcap was set back by 1 s; later turns" in drive.warnings[1]


@pytest.mark.parametrize(
    ("by", "step"),
    [
        (5e8 + 0.25, 2 * PERIOD),
        (7200.0, 2 * PERIOD),  # to another time zone
        (0.0, 30.0 + 2 * PERIOD),
        (0.0, 7230.0 + 2 * PERIOD),
    ],
)
def test_a_clock_that_was_set_ahead_is_no_pause(turns, tmp_path, by, step):
    """A robot that found the time on its way had lost years of scans; a true pause stays."""
    path = write_velodyne(tmp_path / "street.pcap", [turns[0]] * 6)
    pause = 0 if by else round((step - 2 * PERIOD) * 1e6)

    def change(records):
        for record in records[2 * PACKETS * 7 // 2 :]:
            record[0] += by + pause / 1e6
            data, end = record[1], len(record[1]) - 2
            if len(data) > 1206:
                micros = int.from_bytes(data[end - 4 : end], "little") + pause
                record[1] = data[: end - 4] + (micros % 3_600_000_000).to_bytes(4, "little")
                record[1] += data[end:]

    drive = open_drive(rewrite(path, change))
    assert drive.times is not None
    assert np.diff(drive.times) == pytest.approx([PERIOD, PERIOD, step, PERIOD], abs=1e-3)
    told = [one for one in drive.warnings if f"was set ahead by {by:.2g} s; later turns" in one]
    assert len(told) == (1 if by else 0)


def test_two_sensors_of_one_address_are_refused(turns, tmp_path):
    """Their packets were put together to hundreds of turns."""
    path = write_velodyne(tmp_path / "street.pcap", turns)

    def mix(records):
        later = records[PACKETS:] + records[:PACKETS]
        pairs = zip(records[1::2], later[1::2])
        records[:] = [[one[0], each[1]] for one, other in pairs for each in (one, other)]

    refused(open_drive, rewrite(path, mix), match="record each sensor alone")


def test_packets_without_times_of_recording_are_refused_as_such(turns, tmp_path):
    """Two sensors were blamed."""
    path = write_velodyne(tmp_path / "street.pcap", turns)

    def forget(records):
        for record in records:
            record[0] = 0.0

    refused(open_drive, rewrite(path, forget), match="all its packets bear one time, 0 s")


def test_a_file_of_the_next_generation_may_bear_the_old_suffix(turns, tmp_path):
    """So dumpcap writes it."""
    path = write_velodyne(tmp_path / "street.pcapng", turns)
    assert len(open_drive(path.rename(path.with_suffix(".pcap")))) == 3


def test_a_damaged_model_makes_no_hdl64e(turns, tmp_path):
    path = write_velodyne(tmp_path / "street.pcap", turns)

    def damage(records):
        records[5][1] = records[5][1][:-1] + b"\0"

    drive = open_drive(rewrite(path, damage))
    assert len(drive) == 3
    assert len(drive.scan(0)) == pytest.approx(len(points_of(turns[0])), rel=0.03)


def with_calibration(records):
    ends = hdl64e_ends()
    for place, record in enumerate(records[1::2]):
        record[1] = record[1][:-2] + ends[place % len(ends)]


def test_an_hdl64e_brings_its_calibration(turns, tmp_path):
    path = rewrite(write_velodyne(tmp_path / "street.pcap", [turns[0]] * 25), with_calibration)
    packets = pickle.loads(pickle.dumps(open_packets(path)))
    assert len(packets.turns.times) == 25
    model, calibration = packets.turns.sensor
    assert model == velodyne_decoder.Model.HDL64E_S2
    read = velodyne_decoder.Calibration.from_string(calibration)
    assert read.to_string().count("laser_id") == 64
    assert len(packets(0).points) > 0


def test_an_hdl64e_recorded_too_briefly_is_refused(turns, tmp_path):
    path = rewrite(write_velodyne(tmp_path / "street.pcap", turns), with_calibration)
    refused(open_drive, path, match=r"an HDL-64E's calibration, .* is not whole .*record longer")


@pytest.mark.parametrize("sent_by", [(202, 2368), (201, 2369)])
def test_of_two_sensors_the_one_of_most_packets_is_taken(turns, tmp_path, sent_by):
    """Both were taken for one, whose turns were made of pieces of either's."""
    path = tmp_path / "street.pcap"
    alone = open_drive(write_velodyne(path, turns))
    expected = [alone.scan(frame) for frame in range(3)]
    others = [ranges[::-1] for ranges in turns[:2]]
    both = open_drive(write_velodyne(path, turns, others=others, sent_by=sent_by))
    assert both.times == alone.times
    for frame in (2, 0, 1):
        assert np.array_equal(both.scan(frame), expected[frame])
    (told,) = both.warnings
    assert "packets of 2 sensors; those of 192.168.1.201:2368 were taken" in told
    assert f"those of 192.168.1.{sent_by[0]}:{sent_by[1]} left out" in told


def test_an_hdl64e_beside_another_sensor(turns, tmp_path):
    """Its calibration was looked for in both sensors' packets."""
    path = tmp_path / "street.pcap"
    alone = open_drive(write_velodyne(path, turns)).scan(0)
    write_velodyne(path, turns, others=turns[:2], sent_by=(202, 2368), hdl64e=True)
    assert np.array_equal(open_drive(path).scan(0), alone)
    write_velodyne(path, turns, others=turns, sent_by=(202, 2368), hdl64e=True)
    refused(open_drive, path, match=r"an HDL-64E's calibration, .* is not whole .*record longer")


def test_a_cut_recording_is_read_up_to_there(turns, tmp_path):
    path = write_velodyne(tmp_path / "street.pcap", turns)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 5 // 6])
    drive = open_drive(path)
    assert len(drive) == 2
    assert drive.warnings == (
        "street.pcap is cut off or damaged (it ends in the middle of a packet)",
    )


def test_of_a_cut_recording_of_the_next_generation_is_said_why(turns, tmp_path):
    path = write_velodyne(tmp_path / "street.pcapng", turns)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) * 5 // 6])
    (told,) = open_drive(path).warnings
    assert "()" not in told


def test_packets_that_were_not_recorded_whole(turns, tmp_path):
    """The file was said to end there."""
    path = write_velodyne(tmp_path / "street.pcap", turns)

    def cut(records):
        for record in records:
            record[1] = record[1][:96]

    refused(open_drive, rewrite(path, cut), match="its packets are cut short; record whole ones")


def test_what_holds_no_turn_is_refused(turns, tmp_path, monkeypatch):
    path = tmp_path / "street.pcap"
    path.write_bytes(b"nothing of the kind" * 100)
    refused(open_drive, path, match=r"damaged .*; no whole turn of a Velodyne; .* street.json")
    refused(open_drive, write_velodyne(path, []), match="no whole turn of a Velodyne")
    refused(open_drive, path, "/topic", match="has no topics")
    path.with_suffix(".json").write_text("{}")
    monkeypatch.setitem(__import__("sys").modules, "ouster.sdk.pcap", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'wildshape\[ouster\]'"):
        open_drive(path)
