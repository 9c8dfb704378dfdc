# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""When points were taken: counted from their scan's time, whichever clock they are on."""

import struct

import numpy as np
import pytest
from numpy.lib.recfunctions import append_fields
from tests.refusal import refused

from wildshape.io.scans.point_times import seconds_since
from wildshape.io.scans.turns import read_turn

TURN = np.linspace(0.0, 0.1, 200)


@pytest.mark.parametrize("stamp", [0.0, 0.3, 0.9, 1.2, 1.7e9])
def test_values_on_the_scan_s_own_clock_are_counted_from_its_time(stamp):
    assert seconds_since(TURN + stamp, stamp) == pytest.approx(TURN, abs=1e-6)


@pytest.mark.parametrize("late", [0.05, 0.1])
def test_a_scan_may_bear_the_time_of_its_middle_or_its_end(late):
    assert seconds_since(1.7e9 + TURN, 1.7e9 + late) == pytest.approx(TURN - late, abs=1e-6)


@pytest.mark.parametrize("stamp", [0.3, 5.0, 1.7e9])
@pytest.mark.parametrize("first", [-0.05, 0.0])
def test_values_since_the_scan_s_time_are_taken_as_they_are(stamp, first):
    assert seconds_since(TURN + first, stamp) == pytest.approx(TURN + first)


def test_another_clock_begins_with_the_scan_and_no_turn_has_no_times():
    assert seconds_since(TURN + 500.0, 100.0) == pytest.approx(TURN)
    assert seconds_since(TURN * 1000, None) is not None  # milliseconds
    assert seconds_since(np.zeros(200), 1.0) is None
    assert seconds_since(TURN * 10, 1.0) is None  # a share of the turn


@pytest.mark.parametrize(("unit", "kind"), [(1.0, "f8"), (1e-6, "u4"), (1e-9, "u8")])
def test_a_clock_that_counts_within_the_hour_goes_on_past_it(unit, kind):
    """The turn amid which it began anew had no times."""
    values = np.mod(3599.96 + TURN, 3600.0) / unit
    values = values.astype(kind) if kind == "f8" else np.rint(values).astype(kind)
    assert seconds_since(values, 1.7e9) == pytest.approx(TURN, abs=2e-6)


def test_whole_numbers_may_lie_farther_apart_than_their_type_counts():
    values = np.rint(TURN * 1e4 * 64 - 32000).astype("i2")  # microseconds
    assert seconds_since(values, 1.7e9) == pytest.approx(TURN * 0.64 - 0.032, abs=1e-6)


def test_points_that_did_not_come_back_do_not_take_the_times_of_the_others(tmp_path):
    """Drivers fill their rows with zeros, the time too."""
    path, stamp = tmp_path / "scan.ply", 1.7e9
    kinds = {"x": "float", "y": "float", "z": "float", "timestamp": "double"}
    rows = np.zeros(
        201, [(name, "<f8" if kind == "double" else "<f4") for name, kind in kinds.items()]
    )
    rows["x"][1:], rows["timestamp"][1:] = 5.0, stamp + TURN
    listed = "".join(f"property {kind} {name}\n" for name, kind in kinds.items())
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex 201\n{listed}end_header\n"
    path.write_bytes(head.encode() + rows.tobytes())
    turn = read_turn(path, stamp)
    assert turn.seconds is not None
    assert turn.seconds[1:] == pytest.approx(TURN, abs=1e-6)
    assert TURN[0] <= turn.seconds[0] <= TURN[-1]


@pytest.mark.parametrize("kind", ["binary", "binary_compressed", "npy"])
def test_times_are_read_from_packed_clouds_and_from_records_too(tmp_path, kind):
    """They were left out of these without a word."""
    rows = np.zeros(200, [("x", "<f8"), ("flags", "<u2", (3,)), ("y", "<f4"), ("z", "<f4")])
    rows["x"], rows["y"] = np.arange(200) / 7, 5.0
    whole = append_fields(rows, "t", np.rint(TURN * 1e9).astype("<u4"), usemask=False)
    path = tmp_path / ("scan.npy" if kind == "npy" else "scan.pcd")
    write = {"npy": np.save, "binary": write_pcd, "binary_compressed": write_packed_pcd}
    write[kind](path, whole)
    turn = read_turn(path, 1.7e9)
    assert turn.points[:, 0] == pytest.approx(np.arange(200) / 7)
    assert turn.seconds == pytest.approx(TURN, abs=1e-6)


@pytest.mark.parametrize("began", [0.0, 259_200.0, 4.2e8])  # of the scan, the week, less 1e9
@pytest.mark.parametrize("kind", [".las", ".laz"])
def test_times_are_read_from_las_too(tmp_path, kind, began):
    """They were left out of it without a word; points of zeros have none."""
    import laspy

    cloud = laspy.create(point_format=6, file_version="1.4")
    cloud.header.scales = np.full(3, 1e-3)
    cloud.x, cloud.y = np.arange(200) / 8, np.full(200, 5.0)
    cloud.write(tmp_path / f"none{kind}")
    assert read_turn(tmp_path / f"none{kind}", began).seconds is None
    cloud.gps_time = began + TURN
    cloud.write(tmp_path / f"scan{kind}")
    turn = read_turn(tmp_path / f"scan{kind}", began)
    assert turn.points[:, 0] == pytest.approx(np.arange(200) / 8, abs=1e-3)
    assert turn.seconds == pytest.approx(TURN, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("scan.pcd", "FIELDS x y z t\nSIZE 4 4 4 4\nTYPE F F F U\nPOINTS 200\nDATA ascii\n"),
        (
            "scan.ply",
            "ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\n"
            "property float z\nproperty uint t\nend_header\n",
        ),
        (
            "lists.ply",
            "ply\nformat ascii 1.0\nelement vertex 200\nproperty float x\nproperty float y\n"
            "property float z\nproperty uint t\nproperty list uchar int more\nend_header\n",
        ),
    ],
)
def test_times_are_read_from_text_too(tmp_path, name, head):
    """They were left out of it without a word: scans stayed as measured."""
    more = " 2 5 6" * (name == "lists.ply")
    rows = [f"{i / 8} 5 0 {round(time * 1e9)}{more}\n" for i, time in enumerate(TURN)]
    (tmp_path / name).write_text(head + "".join(rows))
    turn = read_turn(tmp_path / name, 1.7e9)
    assert turn.points[:, 0] == pytest.approx(np.arange(200) / 8)
    assert turn.seconds == pytest.approx(TURN, abs=1e-6)
    (tmp_path / name).write_text(head + "".join([*rows[:-1], f"1 5 0 late{more}\n"]))
    refused(read_turn, tmp_path / name, 1.7e9, match=f"{name}: expected a .* file, found a damaged")


def write_pcd(path, rows, data="binary", body=None):
    """Rows of numbers, or what they were packed to."""
    base = {name: rows.dtype[name].base for name in rows.dtype.names}
    lines = {
        "FIELDS": base,
        "SIZE": [kind.itemsize for kind in base.values()],
        "TYPE": [kind.kind.upper() for kind in base.values()],
        "COUNT": [rows[name][0].size for name in base],
        "POINTS": [len(rows)],
        "DATA": [data],
    }
    head = "".join(f"{key} {' '.join(map(str, words))}\n" for key, words in lines.items())
    path.write_bytes(head.encode() + (rows.tobytes() if body is None else body))


def write_packed_pcd(path, rows):
    """All of a field, then all of the next, packed by LZF."""
    import lzf

    whole = b"".join(rows[name].tobytes() for name in rows.dtype.names)
    packed = lzf.compress(whole)
    write_pcd(path, rows, "binary_compressed", struct.pack("<II", len(packed), len(whole)) + packed)
