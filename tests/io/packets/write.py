# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Recordings of packets, written by dpkt: a VLP-16 that sees what a scan shows."""

import numpy as np
from dpkt import ethernet, ip, pcap, pcapng, udp

PERIOD = 0.1
PACKETS, BLOCKS, LASERS = 76, 12, 16
_ELEVATIONS = np.array((-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15.0))
_STEP_DEG = 360.0 / (PACKETS * BLOCKS)
_BLOCK = np.dtype([("flag", "<u2"), ("azimuth", "<u2"), ("beams", [("r", "<u2"), ("i", "u1")], 32)])
_VLP16, _STRONGEST = 0x22, 0x37


def seen_by(points):
    """`(packets, blocks, lasers)` ranges of 2 mm: of a scan, what the beams of a VLP-16 meet."""
    away = np.linalg.norm(points, axis=1)
    up = np.rad2deg(np.arcsin(points[:, 2] / away))
    # A turn begins where the beam looks back.
    around = np.rad2deg(-np.arctan2(points[:, 1], points[:, 0])) % 360
    laser = np.abs(up[:, None] - _ELEVATIONS).argmin(1)
    near = np.abs(up - _ELEVATIONS[laser]) < 0.5
    ranges = np.zeros((PACKETS * BLOCKS, LASERS), np.uint16)
    column = np.rint(((around - 180) % 360) / _STEP_DEG).astype(int) % len(ranges)
    kept = near & (away < 100)
    ranges[column[kept], laser[kept]] = np.rint(away[kept] / 0.002)
    return ranges.reshape(PACKETS, BLOCKS, LASERS)


def write_velodyne(
    path, scans, *, start=1.0e9, turn_back=0, others=(), sent_by=(201, 2368), hdl64e=False
):
    """A recording of one turn a scan.

    Args:
        path: .pcap or .pcapng.
        scans: ranges of each.
        start: when it begins, seconds.
        turn_back: packets left out at the beginning.
        others: ranges of a second sensor, of which each packet comes right before the first's.
        sent_by: end of the second's address, and the port that it sends to.
        hdl64e: the second's packets end as those of an HDL-64E, in bytes that change.
    """
    kind = pcapng.Writer if path.suffix == ".pcapng" else pcap.Writer
    with path.open("wb") as file:
        writer = kind(file)
        for number, ranges in enumerate(scans):
            for place, blocks in enumerate(ranges):
                if number == 0 and place < turn_back:
                    continue
                time = start + PERIOD * (number + place / PACKETS)
                writer.writepkt(_framed(b"\0" * 512, 8308), ts=time)  # the sensor's position
                if number < len(others):
                    packet = _packet(place, others[number][place], time)
                    packet = packet[:-2] + bytes((place, number)) if hdl64e else packet
                    writer.writepkt(_framed(packet, sent_by[1], sent_by[0]), ts=time)
                writer.writepkt(_framed(_packet(place, blocks, time), 2368), ts=time)
    return path


def _packet(place, ranges, time):
    blocks = np.zeros(BLOCKS, _BLOCK)
    turned = 180.0 + (place * BLOCKS + np.arange(BLOCKS)) * _STEP_DEG
    blocks["flag"], blocks["azimuth"] = 0xEEFF, np.rint(turned * 100).astype(int) % 36000
    blocks["beams"]["r"][:, :LASERS], blocks["beams"]["i"] = ranges, 9
    micros = round(time * 1e6) % 3_600_000_000
    return blocks.tobytes() + micros.to_bytes(4, "little") + bytes((_STRONGEST, _VLP16))


def _framed(data, port, host=201):
    datagram = udp.UDP(sport=port, dport=port, ulen=8 + len(data), data=data)
    packet = ip.IP(
        src=bytes((192, 168, 1, host)), dst=b"\xff" * 4, p=ip.IP_PROTO_UDP, data=datagram
    )
    packet.len = 20 + 8 + len(data)
    frame = ethernet.Ethernet(src=b"\0" * 6, dst=b"\xff" * 6, type=0x0800, data=packet)
    return bytes(frame)


def points_of(ranges):
    """`(n, 3)` where the beams of these ranges end, block by block."""
    distances = ranges.reshape(-1, LASERS) * 0.002
    around = -np.deg2rad(180.0 + np.arange(len(distances)) * _STEP_DEG)[:, None]
    up = np.deg2rad(_ELEVATIONS)
    level = np.cos(up) * distances
    places = np.stack(
        (level * np.cos(around), level * np.sin(around), np.sin(up) * distances), axis=-1
    )
    return places[distances > 0.5]


def rewrite(path, change, link=pcap.DLT_EN10MB):
    """Write a `.pcap` again, its records `[seconds, bytes]` changed; every second holds points.

    `link`: the number of their link layer.
    """
    with path.open("rb") as file:
        records = [[float(stamp), data] for stamp, data in pcap.Reader(file)]
    change(records)
    with path.open("wb") as file:
        writer = pcap.Writer(file, linktype=link)
        for stamp, data in records:
            writer.writepkt(data, ts=stamp)
    return path


def hdl64e_ends():
    """What the packets of an HDL-64E S2 end in: the date and state, and a calibration."""
    lasers = [bytes((laser,)) + bytes(20 + 7) for laser in range(64)]
    calibrated = bytes((10, 1, 1, 0, 0, 0, 0))
    sent = b"UNIT#\0\0" + b"".join(lasers)[:-7] + calibrated + bytes(19)
    sent += (len(sent) + 2).to_bytes(2, "little")
    state = dict(zip(b"HMSDNYGTV", (1, 2, 3, 4, 5, 10, 0, 20, 7)))
    return [
        bytes(pair) for pair in [*state.items(), *((49 + k % 7, v) for k, v in enumerate(sent))]
    ]
