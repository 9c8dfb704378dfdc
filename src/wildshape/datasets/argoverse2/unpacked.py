# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How many bytes the buffers of an Arrow stream claim to unpack to, before any is unpacked.

pyarrow tells it nowhere. A record batch lists its buffers in a flatbuffer (Arrow's `Message.fbs`);
each compressed buffer begins with its length when unpacked.
"""

import struct
from typing import Any

import numpy as np

_HEADER = 2  # of Message
_DATA = 1  # of DictionaryBatch
_BUFFERS, _COMPRESSION = 2, 3  # of RecordBatch
_AS_IT_IS = -1
_LENGTH_BYTES = 8


def unpacked_bytes(stream: Any) -> int:
    """Bytes of all compressed buffers of an open stream (`pyarrow.NativeFile`), unpacked.

    Raises:
        Exception: of any kind; the file is damaged.
    """
    from pyarrow import ipc

    total = 0
    while True:
        try:
            message = ipc.read_message(stream)
        except EOFError:
            return total
        if message.type in ("record batch", "dictionary"):
            total += _of_message(message)


def _of_message(message: Any) -> int:
    data, body = message.metadata.to_pybytes(), memoryview(message.body)
    batch = _follow(data, _field(data, _follow(data, 0), _HEADER))
    if message.type == "dictionary":
        batch = _follow(data, _field(data, batch, _DATA))
    if not _field(data, batch, _COMPRESSION):
        return 0
    buffers = _follow(data, _field(data, batch, _BUFFERS))
    (count,) = struct.unpack_from("<I", data, buffers)
    places = np.frombuffer(data, "<i8", 2 * count, buffers + 4).reshape(count, 2).tolist()
    return sum(_of_buffer(body, start, length) for start, length in places if length)


def _of_buffer(body: memoryview, start: int, length: int) -> int:
    if start < 0 or length < _LENGTH_BYTES or start + length > len(body):
        raise ValueError(f"a buffer of {length} bytes at {start} of {len(body)}")
    (unpacked,) = struct.unpack_from("<q", body, start)
    if unpacked < _AS_IT_IS:
        raise ValueError(f"a buffer of {unpacked} bytes")
    return length if unpacked == _AS_IT_IS else unpacked


def _field(data: bytes, table: int, number: int) -> int:
    """Where a field of a flatbuffer's table lies; 0 if it is left out."""
    (back,) = struct.unpack_from("<i", data, table)
    size, offset = table - back, 4 + 2 * number
    (known,) = struct.unpack_from("<H", data, size)
    (place,) = struct.unpack_from("<H", data, size + offset) if offset < known else (0,)
    return table + place if place else 0


def _follow(data: bytes, place: int) -> int:
    return place + struct.unpack_from("<I", data, place)[0]
