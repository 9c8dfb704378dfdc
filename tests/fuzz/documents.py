# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Damage to text with a structure: JSON, XML, tables of numbers."""

import json
import re
from functools import cache
from random import Random
from typing import Any

from tests.fuzz.mutations import ENCODINGS, WORDS, change_lines, replace_number, replace_word

_RAW = {  # what json.dumps would not write
    "@deep@": "[" * 200_000 + "]" * 200_000,
    "@deep objects@": '{"a":' * 50_000 + "1" + "}" * 50_000,
    "@digits@": "9" * 5000,
    "@overflow@": "1e400",
    "@minus@": "-1e400",
    "@raw@": "\ufffe",
    "@twice@": '{"a": 1, "a": 2}',
}
_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 0.5, 1e308, -1e-320, float("nan"), float("inf"), float("-inf")),
    *(
        1 << 31,
        1 << 53,
        1 << 63,
        1 << 64,
        -(1 << 63),
        10**30,
        10**400,
        "",
        "x",
        "0",
        "1e400",
        "nan",
    ),
    *("\ud800", "\0", "\x1b[31m", "../../x", "/", "a" * 5000, "\u202e", "true"),
    *(
        [],
        {},
        [[]],
        [None],
        [1],
        [1, 2, 3],
        [[1, 2], [3]],
        ["x"],
        {"": {}},
        {"x": 1},
        [float("nan")],
    ),
)


def change_json(rng: Random, data: bytes) -> bytes:
    """A value somewhere replaced, lost, doubled, renamed or moved."""
    try:
        root = [json.loads(data)]
    except (ValueError, RecursionError):
        return replace_word(rng, data)
    _change(rng, *_somewhere(rng, root))
    try:
        text = json.dumps(root[0] if root else None, ensure_ascii=rng.random() < 0.9)
    except (ValueError, OverflowError, RecursionError):
        return replace_number(rng, data)
    for mark, raw in _RAW.items():
        text = text.replace(f'"{mark}"', raw)
    encoding = "utf-8" if rng.random() < 0.97 else rng.choice(ENCODINGS)
    return text.encode(encoding, errors="replace")


def change_json_lines(rng: Random, data: bytes) -> bytes:
    """A value of a line, or lines."""
    lines = data.split(b"\n")
    i = rng.randrange(len(lines))
    lines[i] = change_json(rng, lines[i])
    return b"\n".join(lines) if rng.random() < 0.8 else change_lines(rng, data)


def _somewhere(rng: Random, root: list[Any]) -> tuple[Any, Any]:
    """A container and a key in it."""
    holder, key = root, 0
    while isinstance(holder[key], dict | list) and holder[key] and rng.random() < 0.8:
        holder = holder[key]
        key = rng.choice(list(holder)) if isinstance(holder, dict) else rng.randrange(len(holder))
    return holder, key


def _change(rng: Random, holder: Any, key: Any) -> None:
    kind, value = rng.randrange(10), holder[key]
    if kind < 5:
        holder[key] = rng.choice((*_VALUES, *_VALUES, *_RAW))
    elif kind == 5:
        del holder[key]
    elif kind == 6 and isinstance(holder, dict):
        holder[rng.choice((*map(str, holder), "x", ""))] = holder.pop(key)
    elif kind == 6 or (kind == 7 and isinstance(holder, list)):
        holder.insert(key, value)
    elif kind == 7:
        holder[key] = rng.choice(list(holder.values()))
    elif kind == 8:
        holder[key] = rng.choice(([value], {"x": value}, str(value)[:9999], [value] * 3))
    else:
        holder[key] = _near(rng, value)


def _near(rng: Random, value: Any) -> Any:
    """A value of the same type."""
    if isinstance(value, bool) or value is None:
        return not value
    if isinstance(value, int | float):
        near = min(max(value, -1e300), 1e300)
        return rng.choice((-value, near * 1e9, value + 1, near * 1e-9, str(value)[:999]))
    if isinstance(value, str):
        return rng.choice((value[::-1], value + value, value[:-1], value.upper()))
    return list(value)[::-1] if isinstance(value, list) else dict(list(value.items())[1:])


_DECLARED = (
    *(
        "euc-jp",
        "utf-7",
        "gbk",
        "utf-32",
        "utf-16",
        "shift_jis",
        "big5",
        "hz",
        "iso-2022-jp",
        "idna",
    ),
    *(
        "punycode",
        "undefined",
        "unicode_escape",
        "raw_unicode_escape",
        "rot13",
        "hex",
        "zlib",
        "bz2",
    ),
    *("cp037", "latin-1", "ascii", "x" * 300, "", "\u00e9", "mbcs", "utf-8-sig", "utf-8\0"),
)
_DOCTYPES = (
    '<!DOCTYPE a [<!ENTITY e "v">]>',
    '<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE a SYSTEM "http://127.0.0.1:1/x.dtd">',
    '<!DOCTYPE a [<!ENTITY % p SYSTEM "file:///dev/zero"> %p;]>',
)
_SNIPPETS = (
    *(
        "<![CDATA[7]]>",
        "<!-- -->",
        "<?x y?>",
        "&e;",
        "&#0;",
        "&#x110000;",
        "&lt;",
        "<item/>",
        "</item>",
    ),
    *("<item>", "<poses/>", "<count>9</count>", "<a b='c' b='d'/>", "<x:y/>", "\ufffe", "]]>", "&"),
)
_ELEMENT = re.compile(rb"<(\w+)>[^<]*</\1>")
_TEXT = re.compile(rb">[^<>]+<")


def change_xml(rng: Random, data: bytes) -> bytes:
    """Encodings, entities, elements and what is in them."""
    text = data.decode("utf-8", errors="replace")
    match rng.randrange(8):
        case 0:
            return _declared(rng, text)
        case 1:
            return re.sub(r"<!DOCTYPE[^>]*>", lambda _: rng.choice(_DOCTYPES), text).encode()
        case 2 | 3:
            return _with(rng, data, _TEXT, b">" + rng.choice(WORDS).encode() + b"<")
        case 4:
            return _with(rng, data, _ELEMENT, b"")
        case 5:
            return _with(rng, data, _TEXT, b">" + rng.choice(_SNIPPETS).encode() + b"<")
        case 6:
            name = rng.choice(re.findall(r"<(\w+)", text) or ["a"])
            return re.sub(rf"\b{name}\b", rng.choice(("x", "item", "a:b")), text).encode()
        case _:
            at = rng.randrange(len(text) + 1)
            return (text[:at] + rng.choice(_SNIPPETS) + text[at:]).encode(errors="replace")


def _with(rng: Random, data: bytes, pattern: re.Pattern[bytes], new: bytes) -> bytes:
    """A place that the pattern finds, replaced."""
    found = list(pattern.finditer(data))
    if not found:
        return replace_word(rng, data)
    chosen = rng.choice(found)
    return data[: chosen.start()] + new + data[chosen.end() :]


def _declared(rng: Random, text: str) -> bytes:
    """Another encoding said, and perhaps used."""
    name = rng.choice(_DECLARED)
    body = re.sub(r"^<\?xml[^>]*\?>", "", text)
    whole = f'<?xml version="1.0" encoding="{name}"?>{body}'
    try:
        return whole.encode(name if rng.random() < 0.5 else "utf-8")
    except (LookupError, UnicodeError, ValueError):
        return whole.encode(errors="replace")


def change_table(rng: Random, data: bytes) -> bytes:
    """A cell, a column, the header or a quote of a table in text."""
    lines = data.split(b"\n")
    i = rng.randrange(len(lines))
    mark = next((m for m in (b",", b";", b"\t") if m in lines[i]), b" ")
    words = lines[i].split(mark)
    j = rng.randrange(len(words))
    match rng.randrange(7):
        case 0 | 1:
            words[j] = rng.choice(WORDS).encode()
        case 2:
            words[j] = b""
        case 3:
            words.insert(j, rng.choice(WORDS).encode())
        case 4:
            words[j] = b'"' + words[j] + rng.choice((b'"', b"", b'"x', b"\n"))
        case 5:
            return b"\n".join(mark.join(line.split(mark)[:j]) for line in lines)
        case _:
            lines.insert(
                0, rng.choice((b"x,y,z", b"X (m),Y (m),Z (m)", b"# c", b"a b c", b"//", b"\0"))
            )
            return b"\n".join(lines)
    lines[i] = mark.join(words)
    return b"\n".join(lines)


@cache
def laughs() -> bytes:
    """Entities of entities."""
    steps = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10}">' for i in range(1, 12))
    return f'<!DOCTYPE a [<!ENTITY e0 "ha">{steps}]><a>&e11;</a>'.encode()


@cache
def nested_xml() -> bytes:
    """Elements in elements, 200,000 of them."""
    return b"<a>" * 200_000 + b"</a>" * 200_000


@cache
def nested_json() -> bytes:
    """Lists in lists."""
    return _RAW["@deep@"].encode()


@cache
def long_json() -> bytes:
    """A long list of small objects, most expensive for what is written."""
    return b"[" + b"{}," * 300_000 + b"{}]"


@cache
def long_line() -> bytes:
    """100,000 numbers in one line."""
    return b"1 " * 100_000 + b"\n"
