# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The records of a recording of packets, read by dpkt.

In a .pcapng each is of an interface with its own link layer and clock; dpkt's reader takes those of
the first for all.
"""

from collections.abc import Iterator
from typing import IO, Any, Literal, NamedTuple

_SECTION = 0x0A0D0D0A
_LEAST_BYTES = 12  # of a block


class Interface(NamedTuple):
    """What a .pcapng says of an interface.

    Attributes:
        link: number of its link layer.
        ticks: of its clock, a second.
        offset_s: seconds to add to its times.
    """

    link: int
    ticks: float = 1e6
    offset_s: int = 0


class Place(NamedTuple):
    """Where a record begins in the file, and the interfaces that were described before it."""

    at: int
    interfaces: tuple[Interface, ...] = ()


class Record(NamedTuple):
    """What an interface took.

    Attributes:
        link: number of its link layer.
        stamp: when, seconds.
    """

    place: Place
    link: int
    stamp: float
    data: bytes


def records_of(file: IO[bytes], begin: Place | None = None) -> Iterator[Record]:
    """The records, from one on if that is named.

    Raises:
        Exception: no recording, or it is cut off here.
    """
    from dpkt import pcap, pcapng

    reader = pcap.UniversalReader(file)
    if isinstance(reader, pcapng.Reader):
        yield from _of_interfaces(file, reader, begin)
        return
    file.seek(file.tell() if begin is None else begin.at)
    at = file.tell()
    for stamp, data in reader:
        yield Record(Place(at), reader.datalink(), float(stamp), data)
        at = file.tell()


def _of_interfaces(file: IO[bytes], reader: Any, begin: Place | None) -> Iterator[Record]:
    """Those of a .pcapng, whose reader has read the first interface."""
    from dpkt import pcapng

    little = isinstance(reader.idb, pcapng.InterfaceDescriptionBlockLE)
    order: Literal["little", "big"] = "little" if little else "big"
    packets = {
        pcapng.PCAPNG_BT_EPB: pcapng.EnhancedPacketBlockLE
        if little
        else pcapng.EnhancedPacketBlock,
        pcapng.PCAPNG_BT_PB: pcapng.PacketBlockLE if little else pcapng.PacketBlock,
    }
    place = begin or Place(file.tell(), (_interface(reader.idb, order),))
    file.seek(place.at)
    while len(head := file.read(8)) == 8:
        kind, size = (int.from_bytes(head[i : i + 4], order) for i in (0, 4))
        if size < _LEAST_BYTES:
            raise ValueError(f"a block of {size} bytes")
        block, known = head + file.read(size - 8), place.interfaces
        if len(block) < size:
            raise EOFError(f"a block of {size} bytes at its end, or of the other order of bytes")
        if kind == _SECTION:
            known = ()
        elif kind == pcapng.PCAPNG_BT_IDB:
            known = (*known, _interface(type(reader.idb)(block), order))
        elif kind in packets:
            packet = packets[kind](block)
            if packet.iface_id >= len(known):
                raise ValueError(
                    f"a packet of an interface {packet.iface_id} that is not described"
                )
            by = known[packet.iface_id]
            stamp = by.offset_s + ((packet.ts_high << 32) | packet.ts_low) / by.ticks
            yield Record(place, by.link, stamp, packet.pkt_data)
        place = Place(file.tell(), known)


def _interface(block: Any, order: Literal["little", "big"]) -> Interface:
    from dpkt import pcapng

    found = Interface(block.linktype)
    for option in block.opts:
        if option.code == pcapng.PCAPNG_OPT_IF_TSRESOL:
            power = option.data[0]
            found = found._replace(ticks=float((2 if power & 128 else 10) ** (power & 127)))
        elif option.code == pcapng.PCAPNG_OPT_IF_TSOFFSET:
            found = found._replace(offset_s=int.from_bytes(option.data, order, signed=True))
    return found
