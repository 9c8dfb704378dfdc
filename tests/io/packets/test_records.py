# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every record of a `.pcapng` is read by its own interface's link layer and clock."""

import numpy as np
import pytest
from tests.refusal import refused

from wildshape.drives.recordings.recording_kinds import open_drive

pytest.importorskip("velodyne_decoder")

from dpkt import pcap, pcapng
from tests.io.packets.write import BLOCKS, LASERS, PACKETS, write_velodyne

_RAW, _ETHERNET, _UNREAD = 101, 1, 105
_MICRO, _NANO, _HALVES = 6, 9, 128 | 20  # tsresol: powers of 1/10, or of 1/2
_FRAME = 14  # bytes of Ethernet before IP


@pytest.fixture
def recorded(tmp_path):
    """A recording of one interface."""
    rng = np.random.default_rng(0)
    turns = rng.integers(1000, 20000, (4, PACKETS, BLOCKS, LASERS)).astype(np.uint16)
    return write_velodyne(tmp_path / "street.pcap", list(turns))


def _write(recorded, path, interfaces, taken_by):
    """The same of several interfaces.

    Args:
        recorded: the recording.
        path: to write.
        interfaces: link layer, `tsresol` and seconds of offset of each.
        taken_by: number of a record -> of its interface.
    """
    described = []
    for link, resolution, offset in interfaces:
        options = [(pcapng.PCAPNG_OPT_IF_TSRESOL, bytes([resolution]))]
        options += [(pcapng.PCAPNG_OPT_IF_TSOFFSET, offset.to_bytes(8, "little")), (0, b"")]
        block = pcapng.InterfaceDescriptionBlockLE(snaplen=65535, linktype=link)
        block.opts = [pcapng.PcapngOptionLE(code=code, data=data) for code, data in options]
        described.append(block)
    with recorded.open("rb") as old, path.open("wb") as new:
        writer = pcapng.Writer(new, idb=described)
        for number, (stamp, frame) in enumerate(pcap.Reader(old)):
            link, resolution, offset = interfaces[taken_by(number)]
            data = frame[_FRAME:] if link == _RAW else frame
            base = 2 if resolution & 128 else 10
            ticks = round((float(stamp) - offset) * base ** (resolution & 127))
            writer.writepkt(
                pcapng.EnhancedPacketBlockLE(
                    iface_id=taken_by(number),
                    ts_high=ticks >> 32,
                    ts_low=ticks & 0xFFFFFFFF,
                    caplen=len(data),
                    pkt_len=len(data),
                    pkt_data=data,
                )
            )
    return path


@pytest.mark.parametrize(
    "interfaces",
    [
        [(_ETHERNET, _MICRO, 0), (_RAW, _MICRO, 0)],
        [(_RAW, _NANO, 0), (_ETHERNET, _HALVES, 0)],
        [(_ETHERNET, _NANO, 900_000_000), (_ETHERNET, _MICRO, 0)],
        [(_UNREAD, _NANO, 0), (_RAW, _MICRO, 0)],
    ],
)
@pytest.mark.parametrize("mixed", [False, True])
def test_interfaces_differ_in_link_layer_and_clock(recorded, tmp_path, interfaces, mixed):
    """Turns of the second were lost, or had other times, without a word."""
    later = 2 * PACKETS * 2 + 50 if mixed and interfaces[0][0] != _UNREAD else 0
    path = _write(recorded, tmp_path / "two.pcapng", interfaces, lambda n: int(n >= later))
    expected, drive = open_drive(recorded), open_drive(path)
    assert (len(drive), drive.warnings) == (4, ())
    assert drive.times == pytest.approx(expected.times, abs=1e-4)
    for frame in (3, 0, 2):
        np.testing.assert_array_equal(drive.turn(frame).points, expected.turn(frame).points)


def test_each_section_has_interfaces_of_its_own(recorded, tmp_path):
    """As of recordings that were put together by `cat`."""
    one = _write(recorded, tmp_path / "one.pcapng", [(_ETHERNET, _MICRO, 0)], lambda _: 0)
    two = _write(recorded, tmp_path / "two.pcapng", [(_RAW, _NANO, 0)], lambda _: 0)
    one.write_bytes(one.read_bytes() + two.read_bytes())
    expected, drive = open_drive(recorded), open_drive(one)
    assert len(drive) == 8
    np.testing.assert_array_equal(drive.turn(6).points, expected.turn(2).points)


def test_a_section_in_the_other_order_of_bytes_is_told(recorded, tmp_path):
    """All that comes after it was lost without a word."""
    one = _write(recorded, tmp_path / "one.pcapng", [(_ETHERNET, _MICRO, 0)], lambda _: 0)
    header = "0a0d0d0a 0000001c 1a2b3c4d 0001 0000 ffffffffffffffff 0000001c"
    one.write_bytes(one.read_bytes() + bytes.fromhex(header))
    drive = open_drive(one)
    assert len(drive) == 4
    assert drive.warnings == (
        "one.pcapng is cut off or damaged (a block of 469762048 bytes at its end, or of the other"
        " order of bytes)",
    )


def test_a_record_of_an_interface_that_is_not_described(recorded, tmp_path):
    whole = _write(recorded, tmp_path / "one.pcapng", [(_ETHERNET, _MICRO, 0)], lambda _: 0)
    block = b"".join(number.to_bytes(4, "little") for number in (6, 588))  # type and bytes
    changed = whole.read_bytes().replace(block + bytes(4), block + b"\7\0\0\0", 1)
    whole.write_bytes(changed)
    refused(open_drive, whole, match="an interface 7 that is not described")
