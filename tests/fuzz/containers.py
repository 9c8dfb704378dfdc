# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damage inside of containers: zip, gzip, pickle, PNG, safetensors, glTF."""

import gzip
import io
import json
import pickletools
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import cache
from random import Random

import numpy as np
from tests.fuzz.documents import change_json
from tests.fuzz.headers import change_npy
from tests.fuzz.mutations import INTEGERS, damage, packed

BOMB = 128 << 20
"""Bytes that a small file becomes."""
_MOST_UNPACKED = 8 << 20  # of a bomb: packing it again takes seconds, which would count as a hang


def change_zip(rng: Random, data: bytes) -> bytes:
    """Members damaged, renamed, doubled or lost; sizes in the zip's own headers wrong."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(i.file_size for i in archive.infolist()) > _MOST_UNPACKED:
                return damage(rng, data)
            members = [(i.filename, archive.read(i)) for i in archive.infolist()]
    except Exception:  # noqa: BLE001
        return damage(rng, data)
    if not members or rng.random() < 0.3:
        at = data.rfind(rng.choice((b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06")))
        at += 4 + 2 * rng.randrange(20)
        new = packed(rng)
        return data[:at] + new + data[at + len(new) :]
    i = rng.randrange(len(members))
    name, body = members[i]
    match rng.randrange(5):
        case 0 | 1:
            members[i] = name, change_npy(rng, body)
        case 2:
            members[i] = name, damage(rng, body)
        case 3:
            members[i] = rng.choice(("points.npy", "xyz", "a/../b.npy", "\u00e9.npy", ".npy")), body
        case _:
            members.append((rng.choice((name, "data.npy", "pcd.npy")), body))
    return _zipped(
        members, rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA))
    )


def _zipped(members: list[tuple[str, bytes]], how: int) -> bytes:
    import warnings

    file = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a name that comes twice
        with zipfile.ZipFile(file, "w", how) as archive:
            for name, body in members:
                archive.writestr(name, body)
    return file.getvalue()


def change_gzip(
    rng: Random, data: bytes, change: Callable[[Random, bytes], bytes] = damage
) -> bytes:
    """What is inside, packed again."""
    try:
        inner = gzip.GzipFile(fileobj=io.BytesIO(data)).read(_MOST_UNPACKED)
    except (OSError, EOFError, zlib.error):
        return damage(rng, data)
    if len(inner) == _MOST_UNPACKED:
        return damage(rng, data)
    return gzip.compress(change(rng, inner), 1)


def change_pickle(rng: Random, data: bytes) -> bytes:
    """A gzipped pickle, opcode by opcode."""
    return change_gzip(rng, data, _change_opcodes)


_OPCODES = (
    *(
        b"cos\nsystem\n(S'true'\ntR",
        b"cbuiltins\neval\n(S'1'\ntR",
        b"cbuiltins\nslice\n(K\0J\0\0\0\x04NtR",
    ),
    *(
        b"r\0\0\0\x04",
        b"q\xff",
        b"j\xff\xff\xff\x7f",
        b"h\xff",
        b"J\xff\xff\xff\x7f",
        b"I99999999999\n",
    ),
    *(
        b"\x8b\xff\xff\xff\x7f",
        b"B\xff\xff\xff\x7f",
        b"\x8e\0\0\0\0\xff\0\0\0",
        b"\x8d\0\0\0\x40\0\0\0\0",
    ),
    *(
        b"\x96\0\0\0\x40\0\0\0\0",
        b"T\xff\xff\xff\x7f",
        b"\x95\xff\xff\xff\xff\0\0\0\0",
        b"\x80\x05",
    ),
    *(
        b"p99999999\n",
        b"0",
        b"1",
        b"2",
        b"(",
        b"t",
        b"]",
        b"}",
        b")",
        b"\x85",
        b"\x86",
        b"a",
        b"e",
        b"u",
    ),
    *(
        b"b",
        b"R",
        b"\x81",
        b"\x92",
        b".",
        b"N",
        b"\x88",
        b"K\x07",
        b"G\x7f\xf8\0\0\0\0\0\0",
        b"\x97",
    ),
    *(
        b"cnumpy\nndarray\n",
        b"cnumpy\ndtype\n",
        b"cnumpy.core.multiarray\n_reconstruct\n",
        b"\x82\x01",
    ),
    *(
        b"cpandas.core.frame\nDataFrame\n",
        b"c__main__\nx\n",
        b"Pid\n",
        b"Q",
        b"\x93",
        b"\x94",
        b"o",
    ),
)


def _change_opcodes(rng: Random, data: bytes) -> bytes:
    try:
        places = [at or 0 for _, _, at in pickletools.genops(data)]
    except Exception:  # noqa: BLE001
        return damage(rng, data)
    i = rng.randrange(len(places))
    start, end = places[i], [*places[1:], len(data)][i]
    own = data[start:end]
    j = rng.randrange(len(places))
    other = data[places[j] : [*places[1:], len(data)][j]]
    number = own[:1] + packed(rng)[: len(own) - 1].ljust(len(own) - 1, b"\0")
    new = rng.choice((b"", own + own, other, own + other, number, number, b"@", b"@", own + b"@"))
    return data[:start] + new.replace(b"@", rng.choice(_OPCODES)) + data[end:]


def change_png(rng: Random, data: bytes) -> bytes:
    """A field of the header, a chunk lost or doubled, the pixels' bytes; checksums right."""
    chunks = _chunks(data)
    if not chunks:
        return damage(rng, data)
    i = rng.randrange(len(chunks))
    kind, body = chunks[i]
    match rng.randrange(5):
        case 0 | 1:
            i, kind, body = 0, *chunks[0]
            at = rng.choice((0, 4, 8, 9, 10, 11, 12))
            size = 4 if at < 8 else 1
            value = rng.choice((*INTEGERS, 2, 4, 6, 8, 100_000, 20_000)) % (1 << 8 * size)
            chunks[0] = kind, body[:at] + value.to_bytes(size, "big") + body[at + size :]
        case 2:
            chunks[i] = kind, damage(rng, body)
        case 3:
            del chunks[i]
        case _:
            extra = rng.choice(
                (b"tEXt", b"zTXt", b"iCCP", b"PLTE", b"tRNS", b"acTL", b"fdAT", b"gAMA")
            )
            chunks.insert(i, (extra, b"x\0\0" + zlib.compress(bytes(rng.choice((9, 1 << 21))))))
    return data[:8] + b"".join(_chunk(kind, body) for kind, body in chunks)


def _chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    at, found = 8, []
    while at + 12 <= len(data):
        size = struct.unpack_from(">I", data, at)[0]
        found.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    return found


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def change_safetensors(rng: Random, data: bytes) -> bytes:
    """The JSON header, the JSON inside of its metadata, its length, or numbers."""
    size = int.from_bytes(data[:8], "little")
    head, body = data[8 : 8 + size], data[8 + size :]
    match rng.randrange(6):
        case 0 | 1:
            head = change_json(rng, head)
        case 2 | 3:
            head = _change_settings(rng, head)
        case 4:
            values = bytearray(body)
            for _ in range(rng.choice((1, 8)) if len(values) > 8 else 0):
                at = rng.randrange(len(values) - 8) & ~3
                values[at : at + 4] = struct.pack(
                    "<f", rng.choice((float("nan"), float("inf"), 3e38))
                )
            body = bytes(values)
        case _:
            return packed(rng)[:8].ljust(8, b"\0") + data[8:]
    return len(head).to_bytes(8, "little") + head + body


def _change_settings(rng: Random, head: bytes) -> bytes:
    try:
        header = json.loads(head)
        texts = header["__metadata__"]
        key = rng.choice(sorted(texts))
        texts[key] = change_json(rng, texts[key].encode()).decode(errors="replace")
        return json.dumps(header).encode()
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return damage(rng, head)


def change_glb(rng: Random, data: bytes) -> bytes:
    """The JSON chunk of a binary glTF."""
    if len(data) < 20:
        return damage(rng, data)
    size = struct.unpack_from("<I", data, 12)[0]
    head = data[20 : 20 + size]
    for _ in range(rng.choice((1, 1, 2, 3))):
        head = change_json(rng, head)
    head += b" " * (-len(head) % 4)
    rest = data[20 + size :]
    total = 20 + len(head) + len(rest)
    return data[:8] + struct.pack("<II", total, len(head)) + data[16:20] + head + rest


@cache
def gzip_bomb() -> bytes:
    """128 MB of zeros."""
    return gzip.compress(bytes(BOMB), 6)


@cache
def zip_bomb() -> bytes:
    """128 MB of zeros as one column of bytes."""
    return _npz(np.zeros(BOMB, np.uint8))


@cache
def wide_zip_bomb() -> bytes:
    """The same as points with 1,000 numbers each."""
    return _npz(np.zeros((BOMB // 4000, 1000), np.float32))


def _npz(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.savez_compressed(file, points=array)
    return file.getvalue()


@cache
def png_bomb() -> bytes:
    """An image of 8,000 x 8,000 pixels, none of them set."""
    header = struct.pack(">IIBBBBB", 8_000, 8_000, 16, 0, 0, 0, 0)
    pixels = zlib.compress(bytes(16_001 * 8_000), 6)
    parts = ((b"IHDR", header), (b"IDAT", pixels), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*part) for part in parts)
