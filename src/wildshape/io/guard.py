# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every failure of a file or of a library that reads it becomes one sentence.

What is read takes no more memory than ten times the file: promises of headers, JSON and lines of
text are checked before anything is allocated. JSON values become frozen records only if each is of
its field's type and within bounds.
"""

import json
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, Field, fields, is_dataclass
from mmap import mmap
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    IO,
    Any,
    AnyStr,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from wildshape.errors import BadInputError, lacks_memory

MAX_POINTS = 100_000_000
"""More points in one scan of one object are taken for a damaged header."""

Bounds = Mapping[str, tuple[float, float]]
"""Smallest and largest number by the dotted name of a field; those of a tuple share theirs."""

Record = TypeVar("Record")
_ANY_NUMBER = (-1e9, 1e9)
_UNIONS = (Union, UnionType)
_MOST_TIMES, _MOST_BYTES = 10, 64 << 20
_FREE_UNPACKED, _MOST_UNPACKED = 32_000_000, 100
_FREE_BYTES, _RATIO, _CONTAINER_BYTES = 1 << 25, 6, 240
_LONGEST = 1 << 20  # characters: a PCD row may hold many numbers besides its point


@contextmanager
def reading(path: Path, expected: str) -> Iterator[None]:
    """Turn whatever goes wrong inside into a `BadInputError` naming `path` and `expected`.

    Warnings of the libraries are dropped: what matters in a damaged file is an error.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except BadInputError:
        raise
    except FileNotFoundError as error:
        raise BadInputError(f"{path}: no such file; check the path.") from error
    except OSError as error:
        _let_through(error, path)
        reason = error.strerror or first_line(error)
        raise BadInputError(f"{path}: cannot be read as {expected} ({reason}).") from error
    except BaseException as error:
        # Panics of libraries written in Rust (lazrs) are no `Exception`, unlike Ctrl-C they must
        # not end the program.
        if not isinstance(error, Exception) and type(error).__name__ != "PanicException":
            raise
        _let_through(error, path)
        raise BadInputError(
            f"{path}: expected {expected}, found a damaged or foreign file "
            f"({type(error).__name__}: {first_line(error)}); write or copy it again."
        ) from error


def _let_through(error: BaseException, path: Path) -> None:
    """Raise MemoryError where memory is short; a damaged file asks for more than a reader needs.

    No reader needs more than ten times the file and 64 MB: where that much is to be had, it was
    the file that asked for too much.
    """
    if not lacks_memory(error):
        return
    try:
        mmap(-1, _MOST_TIMES * path.stat().st_size + _MOST_BYTES).close()
    except (OSError, ValueError, OverflowError):
        raise MemoryError(first_line(error)) from error


def first_line(error: BaseException, limit: int = 160) -> str:
    """The start of an error's message, on one line."""
    text = " ".join(str(error).split())
    return text if len(text) <= limit else text[: limit - 3] + "..."


def check_unpacked(path: Path, unpacked: int, packed: int) -> None:
    """Refuse a compressed file that unpacks to far more bytes than any scan does.

    Raises:
        BadInputError: over a hundred times as many, and over 32 MB.
    """
    if unpacked > _FREE_UNPACKED + _MOST_UNPACKED * packed:
        raise BadInputError(
            f"{path}: {packed} bytes unpack to {unpacked}, which no scan does: damaged, or made to"
            " fill the memory; write it again."
        )


def check_promise(path: Path, what: str, promised: int, least: int, present: int) -> None:
    """Refuse a header that promises more than its file can hold, before anything is allocated.

    `what` is counted, for example `points`: `promised` of them, which take at least `least` bytes,
    where `present` follow the header.

    Raises:
        BadInputError: the promise is negative, absurd, or does not fit into the file.
    """
    if promised < 0:
        raise BadInputError(f"{path}: the header promises {promised} {what}; write the file again.")
    if least > present:
        raise BadInputError(
            f"{path}: the header promises {promised} {what} (at least {least} bytes), but only "
            f"{present} bytes follow it; the file is truncated or its header is wrong: copy or "
            "write it again."
        )
    if promised > MAX_POINTS:
        raise BadInputError(
            f"{path}: {promised} {what} is more than one scan of one object can hold "
            f"({MAX_POINTS}); cut the objects out of the scan first."
        )


def read_json(path: Path, expected: str, kind: type = object) -> Any:
    """What a JSON file in UTF-8 holds; `kind`: `dict` or `list`, anything by default.

    `expected`: what it should hold, for the error.

    Raises:
        BadInputError: missing, damaged, of another kind, or hardly anything but brackets, which
            take far more memory than they take room in a file.
    """
    with reading(path, expected):
        found = parse_json(path.read_text("utf-8-sig"), path, expected)
    if not isinstance(found, kind):
        raise BadInputError(
            f"{path}: expected {expected}, found {type(found).__name__}; write or copy it again."
        )
    return found


def parse_json(text: str, path: Path, expected: str) -> Any:
    """What a text in JSON holds; see `read_json`.

    Raises:
        BadInputError: hardly anything but brackets.
        ValueError: no JSON.
    """
    containers = text.count("[") + text.count("{")
    if _CONTAINER_BYTES * containers > _FREE_BYTES + _RATIO * len(text):
        raise BadInputError(
            f"{path}: expected {expected}, found {containers} brackets in {len(text)} letters; "
            "write or copy it again."
        )
    return json.loads(text)


def lines_of(file: IO[AnyStr], path: Path, longest: int = _LONGEST) -> Iterator[AnyStr]:
    """The lines that hold something, with their ends.

    Raises:
        BadInputError: a line is longer than `longest`.
    """
    while line := file.readline(longest + 1):
        if len(line) > longest:
            raise BadInputError(
                f"{path}: a line of more than {longest} characters is no point; write x y z a line."
            )
        if not line.isspace():
            yield line


def read_record(path: Path, expected: str, kind: type[Record]) -> Record:
    """The record that a JSON file holds; `expected`: what that is, for the error.

    Raises:
        BadInputError: missing, damaged, or another record.
    """
    with reading(path, expected):
        return record_of(kind, read_json(path, expected), {})


def record_of(kind: type[Record], values: object, bounds: Bounds, at: str = "") -> Record:
    """The record that JSON values describe.

    Args:
        kind: a dataclass, its fields numbers, texts, tuples, records or unions of these; which
            record of a union is meant, `kind` says.
        values: an object's.
        bounds: of numbers, which are finite and below 1e9 elsewhere.
        at: what the values are called in errors.

    Raises:
        ValueError: a value is missing, unknown, of another type or out of its bounds.
    """
    if not isinstance(values, dict):
        raise _wrong(at or "the whole", values, "an object")
    known: dict[str, Field[Any]] = {f.name: f for f in fields(kind)}  # pyright: ignore[reportArgumentType]
    missing = [n for n, f in known.items() if n not in values and _is_needed(f)]
    unknown = [str(name) for name in values if name not in known]
    if missing or unknown:
        told = f"lacks {', '.join(missing)}" if missing else f"has an unknown {unknown[0]}"
        raise ValueError(f"{at or 'the whole'} {told}")
    hints, dot = get_type_hints(kind), f"{at}." if at else ""
    return kind(**{n: _value(hints[n], v, bounds, dot + n) for n, v in values.items()})


def _is_needed(entry: Field[Any]) -> bool:
    return entry.default is MISSING and entry.default_factory is MISSING


def _value(hint: Any, value: Any, bounds: Bounds, at: str) -> Any:
    origin, choices = get_origin(hint), get_args(hint)
    if hint is Any:
        return value
    if origin in _UNIONS:
        return _one_of(choices, value, bounds, at)
    if isinstance(hint, type) and is_dataclass(hint):
        return record_of(hint, value, bounds, at)
    if origin in (tuple, dict):
        return (_tuple if origin is tuple else _dict)(choices, value, bounds, at)
    if hint in (int, float):
        return _number(hint, value, bounds.get(at, _ANY_NUMBER), at)
    allowed = value in choices if origin is Literal else isinstance(value, origin or hint)
    if not allowed:
        expected = (
            " or ".join(map(str, choices)) if origin is Literal else (origin or hint).__name__
        )
        raise _wrong(at, value, expected)
    return value


def _one_of(choices: tuple[Any, ...], value: Any, bounds: Bounds, at: str) -> Any:
    if value is None and NoneType in choices:
        return None
    kinds: dict[str, type[Any]] = {
        kind.__name__: kind for kind in choices if isinstance(kind, type) and is_dataclass(kind)
    }
    if len(kinds) < 2:
        return _value(next(c for c in choices if c is not NoneType), value, bounds, at)
    if not isinstance(value, dict):
        raise _wrong(at, value, "an object")
    named = value.get("kind")
    if not isinstance(named, str) or named not in kinds:
        raise _wrong(f"{at}.kind", named, " or ".join(kinds))
    rest = {k: v for k, v in value.items() if k != "kind"}
    return record_of(kinds[named], rest, bounds, at)


def _tuple(hints: tuple[Any, ...], value: Any, bounds: Bounds, at: str) -> tuple[Any, ...]:
    if not isinstance(value, list):
        raise _wrong(at, value, "a list")
    if hints[-1] is Ellipsis:
        hints = (hints[0],) * len(value)
    if len(value) != len(hints):
        raise _wrong(at, value, f"{len(hints)} values")
    return tuple(_value(h, v, bounds, at) for h, v in zip(hints, value))


def _dict(hints: tuple[Any, ...], value: Any, bounds: Bounds, at: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _wrong(at, value, "an object")
    return {n: _value(hints[1], v, bounds, f"{at}.{n}") for n, v in value.items()}


def _number(hint: type, value: Any, between: tuple[float, float], at: str) -> Any:
    low, high = between
    whole = type(value) is int
    if not (whole or (hint is float and type(value) is float)) or not low <= value <= high:
        expected = "a whole number" if hint is int else "a number"
        raise _wrong(at, value, f"{expected} from {low:.10g} to {high:.10g}")
    return hint(value)


def _wrong(at: str, value: object, expected: str) -> ValueError:
    return ValueError(f"{at} is {first_line(ValueError(repr(value)), 60)}, expected {expected}")
