# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Velodyne's packets, decoded by velodyne-decoder.

A turn ends where the beam looks back: what is ahead is seen at one time. Turns that lack packets,
or amid which nothing came for a while, are left out.
"""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import compress, islice
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from wildshape.errors import BadInputError, load_library
from wildshape.io.guard import first_line, reading
from wildshape.io.packets.clock import gone_on, set_told
from wildshape.io.packets.records import Place, records_of
from wildshape.io.progress import counted
from wildshape.records import Turn

_INSTALL = "pip install 'wildshape[pcap]'"
_AZIMUTH = slice(2, 4)  # of a packet's first block, hundredths of a degree, clockwise from ahead
_MICROS = slice(1200, 1204)  # of the hour
_BACK, _ROUND = 18000, 36000
_UDP_HEADER = 8  # bytes
_SHORTEST_S = 0.025  # of a turn: half of that at the highest speed
_WHOLE = 0.9  # of the packets of the turns around it that a turn must have
_AROUND = 10  # turns before and after: returns and speed may be changed amid a recording
_LONGEST = 1.5  # times the usual time from turn to turn: longer are pieces of several
_LATE = 2000  # hundredths of a degree that a late packet may be behind: two at the highest speed
_FIRST = 100  # packets that tell an HDL-64E; the others' ends change at most where damaged
_LASERS = 64

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

    begin: Place
    source: _Source
    stamp: float
    data: bytes


@dataclass
class _Turn:
    """Where a turn is: its first packet, and how many there are.

    Attributes:
        began: when the first packet was recorded, seconds.
        stamp: when the last was.
        micros: the sensor's own clock then, microseconds past its hour.
        turned: how far from behind the beam has come, hundredths of a degree.
    """

    begin: Place
    packets: int = 0
    began: float = 0.0
    stamp: float = 0.0
    micros: int = 0
    turned: int = 0


@dataclass(frozen=True)
class VelodyneTurns:
    """The turns of a recording, in time order.

    Attributes:
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
            found = list(_packets_of(file, self.source, turn.begin, turn.packets))
        sound = found if self.sensor else _of_one_model(found)
        packets = [decoder.VelodynePacket(one.stamp, one.data) for one in sound]
        scans = decoder.ScanDecoder(_config(self.sensor))
        _, rows = scans.decode(decoder.PacketVector(packets))
        return Turn(np.ascontiguousarray(rows[:, :3]), rows[:, 4].astype(np.float64))


def open_velodyne(path: Path) -> VelodyneTurns:
    """List the turns of a recording, up to where it is cut off; of several sensors those of one.

    Raises:
        MissingExtraError: velodyne-decoder is not installed.
        BadInputError: the sensor is an HDL-64E, whose calibration is not whole.
    """
    _decoder()
    turns: dict[_Source, list[_Turn]] = {}
    models: dict[_Source, Counter[int]] = {}
    warnings = []
    try:
        with path.open("rb") as file:
            for packet in _packets(file):
                _count(packet, turns.setdefault(packet.source, []))
                models.setdefault(packet.source, Counter())[packet.data[-1]] += 1
    except Exception as error:  # noqa: BLE001 - whatever it is, the packets before it are good
        why = first_line(error) or type(error).__name__
        warnings.append(f"{path.name} is cut off or damaged ({why})")
    source = max(turns, key=lambda one: sum(turn.packets for turn in turns[one]), default=None)
    if source is not None and len(turns) > 1:
        others = " and ".join(_named(one) for one in turns if one != source)
        warnings.append(
            f"{path.name} holds packets of {len(turns)} sensors; those of {_named(source)} were"
            f" taken, which are most, and those of {others} left out"
        )
    found = turns[source] if source is not None else []
    _check_pace(path, found)
    sound = _are_whole(found)
    whole = tuple(compress(found, sound))
    # A recording begins and ends amid a turn, which is no loss.
    if lacking := sound[1:-1].count(False):
        warnings.append(f"{counted(lacking, 'turn')} with missing packets left out")
    described = _described(path, source, found) if source is not None and whole else None
    if source is not None and described is None:
        damaged = models[source].total() - max(models[source].values())
        if damaged:
            packets = counted(damaged, "packet")
            warnings.append(f"{packets} of another model than most left out")
    times, by_s = gone_on([turn.stamp for turn in found], [turn.micros for turn in found])
    warnings += set_told(f"the clock of {path.name}", by_s)
    whole_times = tuple(compress(times, sound))
    return VelodyneTurns(path, whole_times, tuple(warnings), source, whole, described)


def _check_pace(path: Path, turns: list[_Turn]) -> None:
    """Refuse turns that are none: packets of two sensors, each of which looks elsewhere.

    Raises:
        BadInputError: most are far shorter than a sensor's, or nothing tells when they were.
    """
    if len(turns) > 2 and turns[0].began == turns[-1].stamp:
        raise BadInputError(
            f"{path}: all its packets bear one time, {turns[0].began:.10g} s: what wrote it lost"
            " the times of recording; record or export it again."
        )
    period = np.median(np.diff([turn.stamp for turn in turns])) if len(turns) > 2 else np.inf
    if abs(period) < _SHORTEST_S:
        raise BadInputError(
            f"{path}: a turn of {period:.2g} s is too short for a Velodyne; record each sensor"
            " alone or with an address of its own, and play recordings back no faster than they"
            " were made."
        )


def _count(packet: _Packet, turns: list[_Turn]) -> None:
    """Add a sensor's next packet to its turns; a late one goes where the one before it went."""
    turned = (int.from_bytes(packet.data[_AZIMUTH], "little") - _BACK) % _ROUND
    if not turns or (turned < turns[-1].turned and not _is_late(turns[-1], turned)):
        turns.append(_Turn(packet.begin, began=packet.stamp, turned=turned))
    turn = turns[-1]
    turn.packets, turn.stamp = turn.packets + 1, packet.stamp
    turn.micros = int.from_bytes(packet.data[_MICROS], "little")
    turn.turned = turn.turned if _is_late(turn, turned) else turned


def _are_whole(turns: list[_Turn]) -> list[bool]:
    """Which turns have as many packets as those around them, and are not pieces of several."""
    packets = np.array([turn.packets for turn in turns])
    periods = np.diff([turn.stamp for turn in turns])
    found = []
    for i, turn in enumerate(turns):
        usual = np.median(packets[max(i - _AROUND, 0) : i + _AROUND + 1])
        period = np.median(periods[max(i - _AROUND, 0) : i + _AROUND]) if len(periods) else np.inf
        lasts = abs(turn.stamp - turn.began)
        found.append(bool(turn.packets >= _WHOLE * usual and lasts <= _LONGEST * period))
    return found


def _is_late(turn: _Turn, turned: int) -> bool:
    return 0 < (turn.turned - turned) % _ROUND <= _LATE


def _named(source: _Source) -> str:
    from dpkt.utils import inet_to_str

    return f"{inet_to_str(source[0])}:{source[1]}"


def _packets(file: IO[bytes], begin: Place | None = None) -> Iterator[_Packet]:
    """The packets of points, from a record on; others are passed over.

    Raises:
        Exception: no recording, or it is cut off here.
    """
    links, size = _links(), _decoder().PACKET_SIZE
    before: dict[_Source, bytes] = {}
    unread = None
    for place, link, stamp, record in records_of(file, begin):
        if link not in links:
            unread = link
            continue
        found, sender = _datagram(links[link](record))
        if found is not None and found.ulen == size + _UDP_HEADER:
            if len(found.data) < size:
                raise EOFError(_cut_told(file))
            source = sender, found.dport
            if found.data != before.get(source):  # a switch's mirror sends packets twice
                yield _Packet(place, source, stamp, found.data)
            before[source] = found.data
    if unread is not None and not before:
        raise ValueError(f"its link layer {unread} is not read; record from a network card")


def _cut_told(file: IO[bytes]) -> str:
    """Why a packet is not whole: the file is not, or no packet was recorded whole."""
    if not file.read(1):
        return "it ends in the middle of a packet"
    return "its packets are cut short; record whole ones, with tcpdump's -s 0"


def _links() -> dict[int, Any]:
    """How a record begins, by the number of its link layer."""
    from dpkt import ethernet, ip, ip6, loopback, sll, sll2

    def raw(record: bytes) -> Any:
        return ip6.IP6(record) if record[:1] >= b"\x60" else ip.IP(record)  # by its version

    # https://www.tcpdump.org/linktypes.html; 113 and 276 are of `tcpdump -i any`
    return {
        0: loopback.Loopback,
        1: ethernet.Ethernet,
        101: raw,
        113: sll.SLL,
        228: raw,
        229: raw,
        276: sll2.SLL2,
    }


def _packets_of(
    file: IO[bytes], source: _Source | None, begin: Place, count: int
) -> Iterator[_Packet]:
    """So many packets of a sensor, from a record on."""
    return islice((one for one in _packets(file, begin) if one.source == source), count)


def _datagram(found: Any) -> tuple[Any, bytes]:
    """What UDP carried, None for other packets; and the address that it came from.

    What ICMP answers quotes the beginning of a packet.
    """
    from dpkt import icmp, icmp6, udp

    sender = b""
    while not isinstance(found, bytes | udp.UDP | icmp.ICMP | icmp6.ICMP6):
        sender, found = getattr(found, "src", sender), found.data
    return (found if isinstance(found, udp.UDP) else None), sender


def _described(path: Path, source: _Source, turns: list[_Turn]) -> _Sensor:
    """An HDL-64E, which sends its own calibration; all others tell their model in each packet.

    Raises:
        BadInputError: it sent too little of it.
    """
    count = sum(turn.packets for turn in turns)
    with reading(path, "packets of a Velodyne"), path.open("rb") as file:
        if not _is_hdl64e(_packets_of(file, source, turns[0].begin, min(count, _FIRST))):
            return None
        file.seek(0)
        sent = _packets_of(file, source, turns[0].begin, count)
        try:
            return _calibrated(one.data for one in sent)
        except (ValueError, KeyError) as error:
            raise BadInputError(
                f"{path}: an HDL-64E's calibration, which it sends over seconds, is not whole"
                f" ({first_line(error)}); record longer."
            ) from error


def _is_hdl64e(packets: Iterator[_Packet]) -> bool:
    """Whether packets end in bytes that change; those of all others end in their model."""
    ends = Counter(one.data[-2:] for one in packets)
    return max(ends.values()) < ends.total() / 2


def _calibrated(sent: Iterator[bytes]) -> _Sensor:
    """The HDL-64E whose packets these are.

    Raises:
        ValueError: they hold no whole calibration.
    """
    decoder = _decoder()
    status = decoder.hdl64e.read_status_info(sent)
    calibration = decoder.hdl64e.status_info_to_calib_dict(status)
    lasers = [laser["laser_id"] for laser in calibration["lasers"]]
    if status["Calibration Time"] is None or lasers != list(range(_LASERS)):
        raise ValueError("it was never calibrated")
    kind = decoder.Model.HDL64E_S2 if status["Model"] == "S2" else decoder.Model.HDL64E_S3
    return int(kind), json.dumps(calibration, default=str)


def _of_one_model(packets: list[_Packet]) -> list[_Packet]:
    """Those that end in the model that most end in: the decoder refuses a turn with others."""
    ((model, _),) = Counter(one.data[-1] for one in packets).most_common(1)
    return [one for one in packets if one.data[-1] == model]


def _config(sensor: _Sensor) -> Any:
    decoder = _decoder()
    if sensor is None:
        return decoder.Config()
    model, calibration = sensor
    read = decoder.Calibration.from_string(calibration)
    return decoder.Config(model=decoder.Model(model), calibration=read)


def _decoder() -> Any:
    return load_library("velodyne_decoder", "packets of Velodyne need velodyne-decoder", _INSTALL)
