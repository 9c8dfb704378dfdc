# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""JSON values become frozen records, each value of its field's type and within bounds."""

from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from wildshape.io.guard import first_line

Bounds = Mapping[str, tuple[float, float]]
"""Smallest and largest number by the dotted name of a field; those of a tuple share theirs."""

_ANY_NUMBER = (-1e9, 1e9)
_UNIONS = (Union, UnionType)
Record = TypeVar("Record")


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
    if origin is tuple:
        return _tuple(choices, value, bounds, at)
    if hint in (int, float):
        return _number(hint, value, bounds.get(at, _ANY_NUMBER), at)
    allowed = value in choices if origin is Literal else type(value) is (origin or hint)
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


def _number(hint: type, value: Any, between: tuple[float, float], at: str) -> Any:
    low, high = between
    whole = type(value) is int
    if not (whole or (hint is float and type(value) is float)) or not low <= value <= high:
        expected = "a whole number" if hint is int else "a number"
        raise _wrong(at, value, f"{expected} from {low:.10g} to {high:.10g}")
    return hint(value)


def _wrong(at: str, value: object, expected: str) -> ValueError:
    return ValueError(f"{at} is {first_line(ValueError(repr(value)), 60)}, expected {expected}")
