# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is handed in from Python where something else is wanted: refused in one sentence, at once.

What can be meant in one way only is taken: text for a `Path`, one for several, a list for a tuple,
numpy's numbers for Python's.
"""

import os
from dataclasses import fields
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from wildshape.errors import BadInputError

Kind = TypeVar("Kind")
_LONGEST = 60
_EXACT = {bool: (bool,), int: (int,), float: (int, float)}  # True is no number
_WORDS = {
    Path: "a path",
    int: "a whole number",
    float: "a number",
    bool: "True or False",
    str: "text",
}


def as_path(value: object, name: str) -> Path:
    """The path that is meant.

    Raises:
        BadInputError: neither a path nor text.
    """
    return _taken(Path, value, name)


def expect(value: object, kind: type[Kind], name: str, cure: str = "") -> Kind:
    """The value, if it is one of a kind.

    Raises:
        BadInputError: it is another; `cure` says what to pass, where the kind's name does not.
    """
    value = _plain(kind, value)
    if isinstance(value, kind):
        return value
    raise _wrong(name, value, _WORDS.get(kind, kind.__name__), cure)


def expect_whole(value: object, name: str, least: int = 0) -> int:
    """The whole number.

    Raises:
        BadInputError: it is none, or below `least`.
    """
    number = _taken(int, value, name)
    if number < least:
        raise BadInputError(f"{name}: expected {least} or more, found {number}.")
    return number


def check_fields(record: object) -> None:
    """For `__post_init__`: every field of a frozen dataclass becomes what its annotation says.

    Looked at are paths, numbers, texts, choices, records, tuples and what may be None; arrays and
    functions are not.

    Raises:
        BadInputError: a field is something else.
    """
    kind = type(record)
    for field, hint in _hints(kind):
        value = getattr(record, field)
        object.__setattr__(record, field, _taken(hint, value, f"{kind.__name__}.{field}"))


@cache
def _hints(kind: type) -> tuple[tuple[str, Any], ...]:
    hints = get_type_hints(kind)
    return tuple((one.name, hints[one.name]) for one in fields(kind))


def _taken(hint: Any, value: Any, name: str) -> Any:
    origin = get_origin(hint)
    if origin in (Union, UnionType):
        return _one_of(get_args(hint), value, name)
    if origin is tuple:
        return _several(get_args(hint), value, name)
    if origin is Literal:
        if not isinstance(value, str) or value not in get_args(hint):
            raise _wrong(name, value, ", ".join(map(str, get_args(hint))))
        return value
    value = _plain(hint, value)
    if not isinstance(hint, type):
        return value  # a function, or whatever there may be
    if not (type(value) in _EXACT[hint] if hint in _EXACT else isinstance(value, hint)):
        raise _wrong(name, value, _WORDS.get(hint, hint.__name__))
    return value


def _plain(hint: Any, value: Any) -> Any:
    """Python's own number of one of numpy or torch, a path of text, and text of a path."""
    if hint in _EXACT and getattr(value, "ndim", None) == 0:
        return value.item()
    if hint in (Path, str) and isinstance(value, os.PathLike | str):
        return Path(value) if hint is Path else os.fspath(value)
    return value


def _one_of(hints: tuple[Any, ...], value: Any, name: str) -> Any:
    if value is None and NoneType in hints:
        return None
    some = [hint for hint in hints if hint is not NoneType]
    if len(some) == 1:
        return _taken(some[0], value, name)
    for hint in some:
        try:
            return _taken(hint, value, name)
        except BadInputError:
            continue
    raise _wrong(name, value, " or ".join(getattr(hint, "__name__", str(hint)) for hint in some))


def _several(hints: tuple[Any, ...], value: Any, name: str) -> tuple[Any, ...]:
    if hasattr(value, "tolist"):
        value = value.tolist()
    endless = hints[-1:] == (Ellipsis,)
    if endless and isinstance(value, str | os.PathLike):
        value = (value,)
    if not isinstance(value, list | tuple) or not (endless or len(value) == len(hints)):
        count = "" if endless else f"{len(hints)} "
        raise _wrong(name, value, f"a tuple of {count}values")
    each = hints[:1] * len(value) if endless else hints
    return tuple(_taken(hint, one, name) for hint, one in zip(each, value))


def _wrong(name: str, value: object, expected: str, cure: str = "") -> BadInputError:
    told = " ".join(repr(value).split())
    told = told if len(told) <= _LONGEST else f"an object of type {type(value).__name__}"
    return BadInputError(f"{name}: expected {expected}, found {told}{cure and f'; {cure}'}.")
