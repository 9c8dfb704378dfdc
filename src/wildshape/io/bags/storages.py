# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The three kinds of file that ROS records into, read from the start on, message by message.

No index at a file's end is needed, so a recording that was cut off is read up to there.
"""

import bz2
import os
import sqlite3
import struct
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import closing, nullcontext, suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import IO, Any, ClassVar, NamedTuple

from wildshape.errors import load_library
from wildshape.io.guard import check_unpacked

CLOUD = "sensor_msgs/msg/PointCloud2"
"""The type of the messages that are read, in the words of ROS 2."""

INSTALL = "pip install 'wildshape[bags]'"
Key = tuple[int, int]


class Message(NamedTuple):
    """A point cloud as recorded.

    Attributes:
        logged: when it was recorded, nanoseconds.
        key: finds it again in its file.
        data: serialized.
        cdr: serialized as ROS 2 does; otherwise as ROS 1 does.
    """

    topic: str
    logged: int
    key: Key
    data: bytes
    cdr: bool


@dataclass(frozen=True)
class Storage(ABC):
    """A file of recorded messages.

    Attributes:
        topics: the type of each topic, known once all messages were read.
    """

    path: Path
    topics: dict[str, str] = field(default_factory=dict)

    @abstractmethod
    def clouds(self) -> Iterator[Message]:
        """All point clouds, in the order of the file; any error means that the rest is damaged."""

    @abstractmethod
    def data(self, key: Key) -> bytes:
        """One message again."""

    def has_cloud(self, topic: str) -> bool:
        """Whether a topic holds point clouds."""
        return self.topics[topic] == CLOUD

    def _message(self, data: bytes) -> bytes:
        """Of a bag whose messages are packed, and any other as it is."""
        if not data.startswith(_ZSTD):
            return data
        zstandard = load_library("zstandard", "compressed bags need zstandard", INSTALL)
        size = zstandard.frame_content_size(data)
        return unpacked(self.path, "zstd", data, size if size >= 0 else _LARGEST_MESSAGE)


class Sqlite(Storage):
    """`.db3` of ROS 2; the key holds the row."""

    def clouds(self) -> Iterator[Message]:
        """See `Storage`."""
        beside = self.path.with_name(f"{self.path.name}-wal")
        waits = beside.is_file() and beside.stat().st_size > 0
        with suppress(sqlite3.Error) if waits else nullcontext():
            yield from self._clouds()
        if waits:  # SQLite would read it, too, but write beside the file
            raise EOFError(
                f"its last messages may be in its -wal file: sqlite3 {self.path.name} 'PRAGMA"
                " wal_checkpoint(TRUNCATE)' moves them"
            )

    def _clouds(self) -> Iterator[Message]:
        with closing(self._open()) as database:
            names = {}
            for row, name, kind in database.execute("SELECT id, name, type FROM topics"):
                self.topics[name] = kind
                names[row] = name
            rows = database.execute(
                "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"
            )
            if self._has_cut_page(database):
                rows = _all_but_last_readable(rows)
            for row, topic, logged, data in rows:
                if self.has_cloud(names[topic]):
                    yield Message(names[topic], logged, (row, 0), self._message(data), True)

    def data(self, key: Key) -> bytes:
        """See `Storage`."""
        with closing(self._open()) as database:
            found = database.execute("SELECT data FROM messages WHERE id = ?", key[:1]).fetchone()
            return self._message(found[0])

    def _open(self) -> sqlite3.Connection:
        address = self.path.resolve().as_uri() + "?mode=ro&immutable=1"
        database = sqlite3.connect(address, uri=True)
        database.execute("PRAGMA writable_schema=ON")  # a file that is cut off opens, too
        return database

    def _has_cut_page(self, database: sqlite3.Connection) -> bool:
        (size,) = database.execute("PRAGMA page_size").fetchone()
        return self.path.stat().st_size % size > 0


def _all_but_last_readable(rows: Iterator[Any]) -> Iterator[Any]:
    """The last row may end in the page that is cut, which SQLite fills with zeros."""
    for row, _ in pairwise(rows):
        yield row
    raise EOFError("it ends in the middle of a page")


_ZSTD = b"\x28\xb5\x2f\xfd"
_LARGEST_MESSAGE = 32_000_000  # bytes, where a message does not say


def unpacked(path: Path, kind: str, data: bytes, size: int) -> bytes:
    """What was packed, `size` bytes of it at most.

    Raises:
        BadInputError: it says that it is far more than a scan can be packed to.
        MissingExtraError: a library is not installed.
    """
    check_unpacked(path, size, len(data))
    match kind:
        case "" | "none":
            return data
        case "bz2":
            return bz2.BZ2Decompressor().decompress(data, size)
        case "lz4":
            lz4 = load_library("lz4.frame", "bags packed with LZ4 need lz4", INSTALL)
            return lz4.LZ4FrameDecompressor().decompress(data, size)
        case "zstd":
            zstandard = load_library("zstandard", "compressed bags need zstandard", INSTALL)
            return zstandard.ZstdDecompressor().stream_reader(data).read(size)
    raise ValueError(f"packed as {kind!r}, not as bz2, lz4 or zstd")


class _Bounded:
    """A file of which never more is asked for than it holds."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self.file, self.size = file, size

    def read(self, count: int) -> bytes:
        """So many bytes, or those that are left."""
        return self.file.read(min(count, max(self.size - self.file.tell(), 0)))


class Mcap(Storage):
    """`.mcap`; the key holds where a record begins, and the place in it if it is a chunk."""

    def clouds(self) -> Iterator[Message]:
        """See `Storage`."""
        reader = load_library("mcap.stream_reader", "MCAP needs mcap", INSTALL)
        schemas: dict[int, str] = {}
        channels: dict[int, Any] = {}
        with self.path.open("rb") as file:
            bounded = _Bounded(file, self.path.stat().st_size)
            records = reader.StreamReader(bounded, emit_chunks=True).records
            begin = 8  # behind the magic
            for record in records:
                for place, part in enumerate(self._parts(record)):
                    match type(part).__name__:
                        case "Schema":
                            schemas[part.id] = part.name
                        case "Channel":
                            channels[part.id] = part
                            self.topics[part.topic] = _modern(schemas.get(part.schema_id, ""))
                        case "Message" if self.has_cloud(channels[part.channel_id].topic):
                            channel = channels[part.channel_id]
                            key, cdr = (begin, place), channel.message_encoding == "cdr"
                            data = self._message(part.data)
                            yield Message(channel.topic, part.log_time, key, data, cdr)
                begin = file.tell()

    def data(self, key: Key) -> bytes:
        """See `Storage`."""
        reader = load_library("mcap.stream_reader", "MCAP needs mcap", INSTALL)
        with self.path.open("rb") as file:
            file.seek(key[0])
            bounded = _Bounded(file, self.path.stat().st_size)
            record = next(reader.StreamReader(bounded, skip_magic=True, emit_chunks=True).records)
            return self._message(self._parts(record)[key[1]].data)

    def _parts(self, record: Any) -> list[Any]:
        """The records of a chunk; any other record alone."""
        if type(record).__name__ != "Chunk":
            return [record]
        size = record.uncompressed_size
        data = unpacked(self.path, record.compression, record.data, size)
        reader = load_library("mcap.stream_reader", "MCAP needs mcap", INSTALL)
        return reader.breakup_chunk(replace(record, compression="", data=data), validate_crc=True)


class Ros1(Storage):
    """`.bag` of ROS 1, version 2.0; the key holds where a chunk begins, and the place in it.

    Format: https://wiki.ros.org/Bags/Format/2.0
    """

    MAGIC: ClassVar[bytes] = b"#ROSBAG V2.0\n"

    def clouds(self) -> Iterator[Message]:
        """See `Storage`."""
        size = self.path.stat().st_size
        names: dict[bytes, str] = {}
        is_whole = False
        with self.path.open("rb") as file:
            if file.read(len(self.MAGIC)) != self.MAGIC:
                raise ValueError("it does not begin as a bag of version 2.0")
            while (begin := file.tell()) < size:
                header, data = _record(file, size)
                if header["op"] == _BAG:
                    is_whole = 0 < _number(header["index_pos"]) <= size
                elif header["op"] == _CHUNK:
                    yield from self._in_chunk(begin, self._chunk(header, data), names)
                elif header["op"] == _CONNECTION:
                    self._connect(header, data, names)
        if not is_whole:
            raise EOFError("it was never closed, or its end is missing")

    def _in_chunk(self, begin: int, chunk: bytes, names: dict[bytes, str]) -> Iterator[Message]:
        at = 0
        while at < len(chunk):
            header, data, after = _parsed(chunk, at)
            if header["op"] == _CONNECTION:
                self._connect(header, data, names)
            elif header["op"] == _MESSAGE and self.has_cloud(names[header["conn"]]):
                seconds, nanoseconds = struct.unpack("<II", header["time"])
                logged = seconds * 10**9 + nanoseconds
                yield Message(names[header["conn"]], logged, (begin, at), data, False)
            at = after

    def data(self, key: Key) -> bytes:
        """See `Storage`."""
        with self.path.open("rb") as file:
            file.seek(key[0])
            header, data = _record(file, self.path.stat().st_size)
        return _parsed(self._chunk(header, data), key[1])[1]

    def _chunk(self, header: dict[str, bytes], data: bytes) -> bytes:
        """The records of a chunk."""
        return unpacked(self.path, header["compression"].decode(), data, _number(header["size"]))

    def _connect(self, header: dict[str, bytes], data: bytes, names: dict[bytes, str]) -> None:
        name = header["topic"].decode()
        names[header["conn"]] = name
        self.topics[name] = _modern(_fields(data)["type"].decode())


_MESSAGE, _BAG, _CHUNK, _CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"


def _modern(kind: str) -> str:
    """The type's name in ROS 2; ROS 1 leaves the middle out."""
    package, _, name = kind.rpartition("/")
    return kind if package.endswith("/msg") or not package else f"{package}/msg/{name}"


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")


def _record(file: IO[bytes], size: int) -> tuple[dict[str, bytes], bytes]:
    """Header and data of the record that begins here; indices are passed over."""
    header = _fields(_sized(file, size))
    if header["op"] in (_BAG, _CHUNK, _CONNECTION):
        return header, _sized(file, size)
    length = _number(file.read(4))
    file.seek(length, os.SEEK_CUR)
    return header, b""


def _sized(file: IO[bytes], size: int) -> bytes:
    """Bytes that follow their number."""
    length = _number(file.read(4))
    if length > size - file.tell():
        raise EOFError("a record is longer than the file")
    return file.read(length)


def _parsed(data: bytes, at: int) -> tuple[dict[str, bytes], bytes, int]:
    """Header and data of the record at a place in a chunk, and where the next one begins."""
    (length,) = struct.unpack_from("<I", data, at)
    begin = at + 4 + length
    (size,) = struct.unpack_from("<I", data, begin)
    end = begin + 4 + size
    if end > len(data):
        raise EOFError("a record is longer than its chunk")
    return _fields(data[at + 4 : begin]), data[begin + 4 : end], end


def _fields(data: bytes) -> dict[str, bytes]:
    """The named values of a header."""
    found, at = {}, 0
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        name, _, value = data[at + 4 : at + 4 + length].partition(b"=")
        found[name.decode()] = value
        at += 4 + length
    return found


STORAGES: dict[str, type[Storage]] = {".db3": Sqlite, ".mcap": Mcap, ".bag": Ros1}
"""By suffix."""


def storage_of(file: Path) -> Storage:
    """What reads a file whose suffix is one of `STORAGES`."""
    return STORAGES[file.suffix.lower()](file)
