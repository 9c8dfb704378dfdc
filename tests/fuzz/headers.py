# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damage to the headers of scans: PLY, PCD, numpy, LAS, ROS."""

import re
import struct
from functools import cache
from random import Random

from tests.fuzz.mutations import FLOATS, INTEGERS, WORDS, change_lines, packed, replace_word

_NUMBERS = (*(str(value) for value in INTEGERS), *WORDS[:40])
_LINES = (
    *("element vertex 3", "element face 2", "element empty 1000000000", "element vertex -1"),
    *("property list uchar int vertex_indices", "property list int float x", "property float x"),
    *("property list uint8 double tags", "property double nothing", "property list float float l"),
    *("format ascii 1.0", "format binary_big_endian 1.0", "format binary_little_endian 1.0"),
    *(
        "comment \xff\xfe",
        "obj_info x",
        "end_header",
        "COUNT 1 1 1 65535",
        "COUNT 0 1 1",
        "HEIGHT 0",
    ),
    *("SIZE 8 8 8", "SIZE 4 4 4 4", "TYPE F F F F", "TYPE I I I", "FIELDS x y z", "FIELDS x y z _"),
    *(
        "POINTS 100000000",
        "WIDTH 4294967296",
        "DATA ascii",
        "DATA binary",
        "DATA binary_compressed",
    ),
    *("VIEWPOINT nan 0 0 0 0 0 0", "VERSION .7", ""),
)
_TYPES = [
    "char",
    "uchar",
    "short",
    "ushort",
    "int",
    "uint",
    "float",
    "double",
    "int8",
    "int64",
    "uint64",
    "float16",
    "float64",
]


def change_header(rng: Random, data: bytes) -> bytes:
    """A header of lines (PLY, PCD): counts, types, lines of another file, lines lost."""
    end = _header_end(data)
    head, body = data[:end], data[end:]
    lines = head.decode("latin-1").split("\n")
    i = rng.randrange(max(len(lines) - 1, 1))
    match rng.randrange(6):
        case 0 | 1:
            words = lines[i].split(" ")
            words[-1 if len(words) < 2 else rng.randrange(1, len(words))] = rng.choice(_NUMBERS)
            lines[i] = " ".join(words)
        case 2:
            words = lines[i].split(" ")
            words[rng.randrange(len(words))] = rng.choice((*_TYPES, *"FIUxyz"))
            lines[i] = " ".join(words)
        case 3:
            lines.insert(i, rng.choice(_LINES))
        case 4:
            return change_lines(rng, head) + body
        case _:
            return replace_word(rng, head) + body
    return "\n".join(lines).encode("latin-1", errors="replace") + body


def _header_end(data: bytes) -> int:
    for mark in (b"end_header\n", b"DATA "):
        at = data.find(mark)
        if at >= 0:
            return data.index(b"\n", at) + 1 if b"\n" in data[at:] else len(data)
    return min(len(data), 400)


_DESCRIPTIONS = (
    *(
        "'<f4'",
        "'>f8'",
        "'<f2'",
        "'<c16'",
        "'|O'",
        "'<U5'",
        "'|V12'",
        "'|S0'",
        "'|b1'",
        "'<M8[ns]'",
    ),
    *(
        "'<i8'",
        "'>u4'",
        "'|V0'",
        "'<f16'",
        "'<U2147483647'",
        "'(2000000000,)f4'",
        "'f4,f4,f4'",
        "3",
    ),
    *("[('x', '<f4'), ('y', '<f4'), ('z', '<f4')]", "[('x', '|O'), ('y', '<f4'), ('z', '<f4')]"),
    *("[('x', '<f4', (1000000,)), ('y', '<f4'), ('z', '<f4')]", "[('x', '<U1')]", "[]", "None"),
)
_SHAPES = (
    *("(0, 3)", "(3,)", "()", "(16, 2)", "(-1, 3)", "(2147483648, 3)", "(9223372036854775807, 3)"),
    *("(4611686018427387904, 4)", "(0, 9223372036854775807)", "(100000000, 0)", "(16, 3.0)", "16"),
    *("(1000000000000, 3)", "(18446744073709551616, 3)", "(True, 3)", "(3, 16)", "(16, 3, 1)"),
)


def change_npy(rng: Random, data: bytes) -> bytes:
    """Another header over the same numbers."""
    if data[:6] != b"\x93NUMPY" or len(data) < 12:
        return replace_word(rng, data)
    size = struct.unpack_from("<H", data, 8)[0]
    head, body = data[10 : 10 + size].decode("latin-1"), data[10 + size :]
    match rng.randrange(5):
        case 0:
            head = _with_entry(head, "descr", rng.choice(_DESCRIPTIONS))
        case 1:
            head = _with_entry(head, "shape", rng.choice(_SHAPES))
        case 2:
            head = _with_entry(head, "fortran_order", rng.choice(("True", "1", "None", "'x'")))
        case 3:
            head = replace_word(rng, head.encode()).decode("latin-1")
        case _:
            return data[:6] + bytes(rng.choice(((2, 0), (3, 0), (1, 1), (9, 9)))) + data[8:]
    text = head.rstrip().encode("latin-1", errors="replace")
    return data[:8] + struct.pack("<H", min(len(text) + 1, 65535)) + text + b"\n" + body


def _with_entry(head: str, key: str, value: str) -> str:
    """The header with one value replaced; it is text, and may make no sense already."""
    start = head.find(f"'{key}':")
    if start < 0:
        return head + value
    ends = [at for at in (head.find(", '", start + 9), head.find("}", start)) if at > 0]
    return f"{head[:start]}'{key}': {value}{head[min(ends, default=len(head)) :]}"


_LAS_FIELDS = (  # offset and type of what a header says
    *((24, "B"), (25, "B"), (94, "H"), (96, "I"), (96, "I"), (100, "I"), (100, "I"), (104, "B")),
    *(
        (104, "B"),
        (105, "H"),
        (107, "I"),
        (107, "I"),
        (111, "I"),
        (131, "d"),
        (139, "d"),
        (147, "d"),
    ),
    *(
        (155, "d"),
        (163, "d"),
        (171, "d"),
        (179, "d"),
        (227, "Q"),
        (235, "Q"),
        (243, "I"),
        (247, "Q"),
    ),
    (255, "Q"),
)
_RECORD_FIELDS = ((2, "Q"), (18, "H"), (20, "H"), (20, "H"))
_LASZIP_FIELDS = (
    *((54, "H"), (56, "H"), (58, "B"), (62, "I"), (66, "I"), (66, "I"), (70, "q"), (78, "q")),
    *((86, "H"), (86, "H"), (88, "H"), (90, "H"), (92, "H"), (94, "H"), (96, "H"), (98, "H")),
)


def change_las(rng: Random, data: bytes) -> bytes:
    """A field of a LAS header, of a variable length record, of LAZ's own record or chunk table."""
    if len(data) < 235:
        return replace_word(rng, data)
    size, points = struct.unpack_from("<HI", data, 94)
    match rng.randrange(6):
        case 0 | 1 | 2:
            at, code = rng.choice(_LAS_FIELDS)
        case 3:
            at, code = rng.choice(_RECORD_FIELDS)
            at += size
        case 4:
            at, code = rng.choice(_LASZIP_FIELDS)
            at += size
        case _:
            at, code = points + 4 * rng.randrange(12), "I"
            table = int.from_bytes(data[points : points + 8], "little")
            if rng.random() < 0.5 and table < len(data):
                at = table + 4 * rng.randrange(4)
    new = _value(rng, code)
    return data[:at] + new + data[at + len(new) :] if at < len(data) else data + packed(rng)


def _value(rng: Random, code: str) -> bytes:
    if code == "d":
        return struct.pack("<d", rng.choice(FLOATS))
    size = struct.calcsize("<" + code)
    near = rng.randrange(40) if rng.random() < 0.4 else rng.choice(INTEGERS)
    return (near % (1 << 8 * size)).to_bytes(size, "little")


def change_cloud(rng: Random, data: bytes) -> bytes:
    """A number behind the frame's name in a ROS message: sizes, fields, steps of its points."""
    names = [found.end() for found in re.finditer(b"lidar", data)]
    if not names:
        return replace_word(rng, data)
    at, new = rng.choice(names) + rng.randrange(160), packed(rng)
    return data[:at] + new + data[at + len(new) :]


@cache
def empty_faces() -> bytes:
    """A PLY of two million faces without corners, before the points."""
    head = "ply\nformat binary_little_endian 1.0\nelement face 2000000\nproperty list uchar int v\n"
    head += "element vertex 16\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    return head.encode() + bytes(2_000_000) + struct.pack("<48f", *range(48))


@cache
def empty_faces_text() -> bytes:
    """The same as text."""
    head = empty_faces()[:220].split(b"end_header")[0].replace(b"binary_little_endian", b"ascii")
    rows = b"\n".join(b"%d %d %d" % (i, i, i % 3) for i in range(16))
    return head + b"end_header\n" + b"0\n" * 2_000_000 + rows + b"\n"


@cache
def many_records() -> bytes:
    """A LAS whose header claims millions of records that no byte stands for."""
    head = bytearray(375)
    head[:4], head[24:26] = b"LASF", bytes((1, 4))
    struct.pack_into("<HII", head, 94, 375, 1 << 30, 19_000_000)
    struct.pack_into("<BH", head, 104, 6, 30)
    return bytes(head) + bytes(1200)
