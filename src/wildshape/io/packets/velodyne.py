# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Velodyne's packets, decoded by velodyne-decoder.

A turn ends where the beam looks back: what is ahead is seen at one time.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from wildshape.errors import BadInputError, load_library
from wildshape.io.guard import first_line
from wildshape.records import Turn

_INSTALL = "pip install 'wildshape[pcap]'"
_AZIMUTH = slice(2, 4)  # of a packet's first block, hundredths of a degree, clockwise from ahead
_BACK, _ROUND = 18000, 36000
_UDP_HEADER = 8  # bytes
_WHOLE = 0.9  # of a turn's packets that the first and the last turn must have

_Sensor = tuple[int, str] | None  # model and calibration of a sensor that sends them
_Source = tuple[bytes, int]  # address of a sensor and the port that it sends to


class _Packet(NamedTuple):
    """A packet of points.

    Attributes:
        begin: where its record begins in the file.
        source: the sensor that sent it.
        stamp: when it was recorded, seconds.
        data: as the sensor sent it.
    """

    begin: int
    source: _Source
    stamp: float
    data: bytes


@dataclass
class _Turn:
    """Where a turn is: its first packet, and how many there are.

    Attributes:
        stamp: when the last was recorded, seconds.
        turned: how far from behind the beam was then, hundredths of a degree.
    """

    begin: int
    packets: int = 0
    stamp: float = 0.0
    turned: int = 0


@dataclass(frozen=True)
class VelodyneTurns:
    """The turns of a recording, in time order.

    Attributes:
        path: of the file.
        times: of each turn's last packet, seconds.
        warnings: what is odd about it, a sentence each.
        source: the sensor whose turns they are, if there are any.
    """

    path: Path
    times: tuple[float, ...]
    warnings: tuple[str, ...]
    source: _Source | None
    turns: tuple[_Turn, ...] = field(repr=False)
    sensor: _Sensor = None

    def __call__(self, number: int) -> Turn:
        """The points of a turn that have a return, and when each was taken.

        Raises:
            Exception: damaged.
        """
        decoder, turn = _decoder(), self.turns[number]
        with self.path.open("rb") as file:
            found = _packets_of(file, self.source, turn)
            packets = [decoder.VelodynePacket(one.stamp, one.data) for one in found]
        scans = decoder.ScanDecoder(_config(self.sensor))
        _, rows = scans.decode(decoder.PacketVector(packets))
        return Turn(np.ascontiguousarray(rows[:, :3]), rows[:, 4].astype(np.float64))


def open_velodyne(path: Path) -> VelodyneTurns:
    """List the turns of a recording, up to where it is cut off; of several sensors those of one.

    Raises:
        MissingExtraError: velodyne-decoder is not installed.
        BadInputError: the sensor is an HDL-64E, and not alone.
    """
    _decoder()
    turns: dict[_Source, list[_Turn]] = {}
    warnings = []
    try:
        with path.open("rb") as file:
            for packet in _packets(file):
                _count(packet, turns.setdefault(packet.source, []))
    except Exception as error:  # noqa: BLE001 - whatever it is, the packets before it are good
        warnings.append(f"{path.name} is cut off or damaged ({first_line(error)})")
    source = max(turns, key=lambda one: sum(turn.packets for turn in turns[one]), default=None)
    if source is not None and len(turns) > 1:
        others = " and ".join(_named(one) for one in turns if one != source)
        warnings.append(
            f"{path.name} holds packets of {len(turns)} sensors; those of {_named(source)} were"
            f" taken, which are most, and those of {others} left out"
        )
    whole = tuple(_whole(turns[source])) if source is not None else ()
    times = tuple(turn.stamp for turn in whole)
    if source is not None and len(turns) > 1 and whole and _is_hdl64e(path, source, whole[0]):
        raise BadInputError(
            f"{path}: holds packets of an HDL-64E ({_named(source)}) and of other sensors; copy"
            " those of the HDL-64E to a file of their own."
        )
    described = _described(path) if whole and len(turns) == 1 else None
    return VelodyneTurns(path, times, tuple(warnings), source, whole, described)


def _is_hdl64e(path: Path, source: _Source, turn: _Turn) -> bool:
    """Whether packets end in bytes that change; those of all others end in their model."""
    with path.open("rb") as file:
        return len({one.data[-2:] for one in _packets_of(file, source, turn)}) > 1


def _count(packet: _Packet, turns: list[_Turn]) -> None:
    """Add a sensor's next packet to its turns."""
    turned = (int.from_bytes(packet.data[_AZIMUTH], "little") - _BACK) % _ROUND
    if not turns or turned < turns[-1].turned:
        turns.append(_Turn(packet.begin))
    turns[-1].packets += 1
    turns[-1].stamp, turns[-1].turned = packet.stamp, turned


def _named(source: _Source) -> str:
    from dpkt.utils import inet_to_str

    return f"{inet_to_str(source[0])}:{source[1]}"


def _whole(turns: list[_Turn]) -> list[_Turn]:
    """All but a first or last that is not a whole turn."""
    least = _WHOLE * float(np.median([turn.packets for turn in turns] or [0]))
    ends = (0, len(turns) - 1)
    return [turn for place, turn in enumerate(turns) if place not in ends or turn.packets >= least]


def _packets(file: IO[bytes], begin: int | None = None) -> Iterator[_Packet]:
    """The packets of points, from a record on; others are passed over.

    Raises:
        Exception: no recording, or it is cut off here.
    """
    from dpkt import pcap

    records = pcap.UniversalReader(file)
    size = _decoder().PACKET_SIZE
    if begin is not None:
        file.seek(begin)
    begin = file.tell()
    for stamp, record in records:
        found, sender = _datagram(record)
        if found is not None and len(found.data) < found.ulen - _UDP_HEADER:
            raise EOFError("it ends in the middle of a packet")
        if found is not None and len(found.data) == size:
            yield _Packet(begin, (sender, found.dport), float(stamp), found.data)
        begin = file.tell()


def _packets_of(file: IO[bytes], source: _Source | None, turn: _Turn) -> Iterator[_Packet]:
    """The packets of a sensor's turn."""
    ours = (one for one in _packets(file, turn.begin) if one.source == source)
    return islice(ours, turn.packets)


def _datagram(record: bytes) -> tuple[Any, bytes]:
    """What UDP carried, None for other packets; and the address that it came from."""
    from dpkt import ethernet, udp

    found: Any = ethernet.Ethernet(record)
    sender = b""
    while not isinstance(found, bytes | udp.UDP):
        sender, found = getattr(found, "src", sender), found.data
    return (None if isinstance(found, bytes) else found), sender


def _described(path: Path) -> _Sensor:
    """An HDL-64E, which sends its own calibration; all others tell their model in each packet.

    The decoder looks for a calibration in .pcap alone.
    """
    if path.suffix.lower() != ".pcap":
        return None
    model, calibration = _decoder().hdl64e.detect_hdl64e(path)
    return None if model is None else (int(model), calibration.to_string())


def _config(sensor: _Sensor) -> Any:
    decoder = _decoder()
    if sensor is None:
        return decoder.Config()
    model, calibration = sensor
    read = decoder.Calibration.from_string(calibration)
    return decoder.Config(model=decoder.Model(model), calibration=read)


def _decoder() -> Any:
    return load_library("velodyne_decoder", "packets of Velodyne need velodyne-decoder", _INSTALL)
