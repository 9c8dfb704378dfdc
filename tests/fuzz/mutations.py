# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damage that needs no knowledge of a format: bytes, blocks, numbers, words, lines, encodings."""

import re
import struct
from collections.abc import Callable
from random import Random

Mutation = Callable[[Random, bytes], bytes]

LARGEST = 1 << 20
"""Inputs stay this small, bombs apart."""

INTEGERS = (
    *(0, 1, 2, 3, 7, 16, 127, 128, 255, 256, 4095, 32767, 32768, 65535, 65536, 1 << 24),
    *(60_000_000, 100_000_000, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, 1 << 32, 1 << 53),
    *((1 << 63) - 1, 1 << 63, (1 << 64) - 1, 1 << 64, -1, -2, -128, -(1 << 31), -(1 << 63)),
)
FLOATS = (0.0, -0.0, 1e-320, 1e30, 1e38, 3.5e38, 1e308, float("inf"), float("-inf"), float("nan"))
WORDS = (
    *(str(value) for value in INTEGERS),
    *("nan", "-nan", "NaN", "inf", "-inf", "Infinity", "1e400", "-1e400", "1e-400", "1e38", "4e38"),
    *(
        "",
        " ",
        "x",
        "-",
        "+",
        ".",
        "0x10",
        "1_000",
        "1,5",
        "1e",
        "--1",
        "1.2.3",
        "\u0663",
        "\u00bd",
    ),
    *(
        "true",
        "None",
        "null",
        "\0",
        "\x1b[2J",
        "\u202e",
        "\ufeff",
        "9" * 400,
        "9" * 5000,
        "%s",
        "{}",
    ),
    *("../../etc/passwd", "/dev/zero", "a" * 300, "\u00e9", "\n", "#", "//", '"', "'"),
)
ENCODINGS = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "latin-1", "utf-7", "euc-jp", "cp037")
_TOKEN = re.compile(rb"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?|[A-Za-z_]+")
_NUMBER = re.compile(rb"[-+]?[0-9][0-9.]*(?:[eE][-+]?[0-9]+)?")


def place(rng: Random, data: bytes) -> int:
    """Anywhere, the beginning and the end more often."""
    size = max(len(data), 1)
    return (
        rng.randrange(size),
        rng.randrange(min(size, 256)),
        size - 1 - rng.randrange(min(size, 64)),
    )[rng.choice((0, 0, 1, 1, 2))]


def packed(rng: Random) -> bytes:
    """A number at a limit, in some type and byte order."""
    code = rng.choice("bBhHiIqQfd")
    order = rng.choice("<<>")
    if code in "fd":
        value = rng.choice(FLOATS)
        return struct.pack(order + code, value if code == "d" or abs(value) < 3e38 else 3e38)
    size = struct.calcsize(code)
    value = rng.choice(INTEGERS) + rng.choice((0, 0, 0, 1, -1))
    return (value % (1 << 8 * size)).to_bytes(size, "little" if order == "<" else "big")


def flip_bits(rng: Random, data: bytes) -> bytes:
    """One to eight bits."""
    found = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8)) if data else 0):
        found[place(rng, data)] ^= 1 << rng.randrange(8)
    return bytes(found)


def set_number(rng: Random, data: bytes) -> bytes:
    """A number at a limit over what is there."""
    at, new = place(rng, data), packed(rng)
    return data[:at] + new + data[at + len(new) :]


def set_aligned_number(rng: Random, data: bytes) -> bytes:
    """The same at a place that 4 divides."""
    at, new = place(rng, data) & ~3, packed(rng)
    return data[:at] + new + data[at + len(new) :]


def truncate(rng: Random, data: bytes) -> bytes:
    """Lose the end."""
    return data[: place(rng, data)]


def remove_block(rng: Random, data: bytes) -> bytes:
    """Lose some of the middle."""
    at = place(rng, data)
    return data[:at] + data[at + rng.choice((1, 2, 4, 16, 64, 512)) :]


def repeat_block(rng: Random, data: bytes) -> bytes:
    """Some of it twice, or a thousand times."""
    at, size = place(rng, data), rng.choice((1, 2, 4, 16, 64, 512))
    return data[:at] + data[at : at + size] * rng.choice((2, 2, 3, 50, 1000)) + data[at + size :]


def insert_bytes(rng: Random, data: bytes) -> bytes:
    """Foreign bytes between."""
    at, size = place(rng, data), rng.choice((1, 2, 4, 16, 64))
    new = rng.choice((rng.randbytes(size), bytes(size), b"\xff" * size, b" " * size, b"\n" * size))
    return data[:at] + new + data[at:]


def fill_block(rng: Random, data: bytes) -> bytes:
    """Zeros, ones or noise over some of it."""
    at, size = place(rng, data), rng.choice((4, 16, 64, 512))
    size = min(size, len(data) - at)
    new = rng.choice((bytes(size), b"\xff" * size, rng.randbytes(size)))
    return data[:at] + new + data[at + size :]


def move_block(rng: Random, data: bytes) -> bytes:
    """Two parts in the wrong order."""
    a, b = sorted((place(rng, data), place(rng, data)))
    return data[b:] + data[a:b] + data[:a]


def replace_word(rng: Random, data: bytes, pattern: re.Pattern[bytes] = _TOKEN) -> bytes:
    """A word or number of text becomes another one."""
    found = pattern.search(data, place(rng, data)) or pattern.search(data)
    if found is None:
        return set_number(rng, data)
    new = rng.choice(WORDS).encode()
    return data[: found.start()] + new + data[found.end() :]


def replace_number(rng: Random, data: bytes) -> bytes:
    """A number of text becomes another one."""
    return replace_word(rng, data, _NUMBER)


def change_lines(rng: Random, data: bytes) -> bytes:
    """Lines lost, doubled, in another order, joined or empty."""
    lines = data.split(b"\n")
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    match rng.randrange(6):
        case 0:
            del lines[i]
        case 1:
            lines.insert(j, lines[i])
        case 2:
            lines[i], lines[j] = lines[j], lines[i]
        case 3:
            lines[i] = b" ".join(lines[i : i + 2])
        case 4:
            lines[i] = b""
        case _:
            words = lines[i].split(b" ")
            del words[rng.randrange(len(words))]
            lines[i] = b" ".join(words)
    return b"\n".join(lines)


def change_separators(rng: Random, data: bytes) -> bytes:
    """Blanks and line ends become others, everywhere."""
    old, new = rng.choice(
        (
            *((b"\n", b"\r"), (b"\n", b"\r\n"), (b"\n", b""), (b" ", b","), (b" ", b";")),
            *((b" ", b"\t"), (b",", b" "), (b" ", b"  "), (b" ", b"\0"), (b".", b",")),
            (b" ", b"\xc2\xa0"),
        )
    )
    return data.replace(old, new)


def encode_again(rng: Random, data: bytes) -> bytes:
    """Text in another encoding, perhaps with its mark."""
    text = data.decode("utf-8", errors="replace")
    return text.encode(rng.choice(ENCODINGS), errors="replace")


_BINARY: tuple[Mutation, ...] = (
    *(flip_bits, flip_bits, set_number, set_number, set_aligned_number, truncate, remove_block),
    *(repeat_block, insert_bytes, fill_block, move_block, replace_word),
)
_TEXT: tuple[Mutation, ...] = (
    *(replace_word, replace_word, replace_number, replace_number, replace_number, change_lines),
    *(change_lines, change_separators, encode_again, insert_bytes, truncate, repeat_block),
    *(flip_bits, remove_block, set_number),
)


def is_text(data: bytes) -> bool:
    """Whether it begins as text does."""
    return b"\0" not in data[:512] and all(byte < 127 for byte in data[:64])


def damage(rng: Random, data: bytes) -> bytes:
    """One of the above, as it fits."""
    return rng.choice(_TEXT if is_text(data) else _BINARY)(rng, data)


def splice(rng: Random, data: bytes, other: bytes) -> bytes:
    """The beginning of one file and the end of another."""
    return data[: place(rng, data)] + other[place(rng, other) :]
