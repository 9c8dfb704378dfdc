# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of an Ouster, written by its SDK: every turn comes back, in time."""

import pickle

import numpy as np
import pytest

from wildshape.drives.recordings.recording_kinds import open_drive
from wildshape.io.packets.ouster import columns_sent

TENTH = 10**8


@pytest.mark.parametrize(
    ("window", "columns"),
    [
        (None, [0, 1, 2, 3, 4, 5, 6, 7]),
        ((0, 7), [0, 1, 2, 3, 4, 5, 6, 7]),
        ((2, 4), [2, 3, 4]),
        ((6, 1), [6, 7, 0, 1]),
    ],
)
def test_the_columns_of_an_ouster_s_window(window, columns):
    assert columns_sent(window, 8).tolist() == columns


def write_ouster(path, stamps, recorded):
    """A recording beside its `.json`; the points that each turn shows.

    Args:
        path: .pcap.
        stamps: of each turn's first column, nanoseconds.
        recorded: when its packets were, nanoseconds.
    """
    pcap, core = pytest.importorskip("ouster.sdk.pcap"), pytest.importorskip("ouster.sdk.core")
    info = core.SensorInfo.from_default(core.LidarMode._512x10)
    info.config.udp_port_lidar, info.config.udp_port_imu, info.fw_rev = 7502, 7503, "v2.5.3"
    path.with_suffix(".json").write_text(info.to_json_string())
    rng, packets, seen = np.random.default_rng(0), [], []
    for number, stamp in enumerate(stamps):
        frame = core.LidarFrame(info)
        ranges = frame.field("RANGE")
        ranges[:] = rng.integers(2000, 50000, ranges.shape) * (rng.random(ranges.shape) < 0.5)
        seen.append(core.XYZLut(info)(frame)[ranges > 0])
        frame.frame_id, frame.status[:] = number + 1, 1
        frame.measurement_id[:] = np.arange(frame.w)
        frame.timestamp[:] = stamp + np.arange(frame.w) * TENTH // frame.w
        turn = core.frame_to_packets(frame, core.PacketFormat(info), info.init_id, info.sn)
        for packet in turn:
            packet.host_timestamp = recorded[number]
        packets += turn
    pcap.record(iter(packets), str(path))
    return seen


def test_an_ouster_s_turns_come_back(tmp_path):
    stamps = [10**15 + number * TENTH for number in range(3)]
    seen = write_ouster(tmp_path / "street.pcap", stamps, stamps)
    drive = pickle.loads(pickle.dumps(open_drive(tmp_path / "street.pcap")))
    assert drive.times == pytest.approx([1e6, 1e6 + 0.1, 1e6 + 0.2])
    for frame in (2, 0, 1):
        turn = drive.turn(frame)
        assert np.allclose(turn.points, seen[frame], atol=1e-3)
        assert 0 <= turn.seconds.min() < turn.seconds.max() < 0.1


@pytest.mark.parametrize(("by_s", "way"), [(1.7e9, "ahead"), (3600, "ahead"), (-5, "back")])
def test_where_an_ouster_s_clock_was_set_turns_go_on(tmp_path, by_s, way):
    """One that found its master on the way had lost a thousand million scans, or was refused."""
    recorded = [2 * 10**18 + number * TENTH for number in range(6)]
    stamps = [
        10**15 + number * TENTH + (int(by_s) * 10**9 if number > 2 else 0) for number in range(6)
    ]
    write_ouster(tmp_path / "street.pcap", stamps, recorded)
    drive = open_drive(tmp_path / "street.pcap")
    assert drive.ticks == tuple(range(6))
    assert drive.times == pytest.approx(1e6 + np.arange(6) / 10, abs=1e-5)
    (told,) = drive.warnings
    assert told.startswith(
        f"the sensor's clock in street.pcap was set {way} by {abs(by_s):.2g} s; later turns are"
    )


def test_a_pause_of_an_ouster_s_recording_stays(tmp_path):
    pause = [30 * 10**9 if number > 2 else 0 for number in range(6)]
    stamps = [10**15 + number * TENTH + pause[number] for number in range(6)]
    write_ouster(tmp_path / "street.pcap", stamps, [10**18 + one for one in stamps])
    drive = open_drive(tmp_path / "street.pcap")
    assert drive.times is not None
    assert np.diff(drive.times) == pytest.approx([0.1, 0.1, 30.1, 0.1, 0.1])
