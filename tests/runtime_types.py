# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Types are checked at each call, as by `jaxtyping.jaxtyped`, in less time.

That one binds all arguments by name and checks them twice a call, for its messages. Here a function
that names no array is beartype's alone; where shapes are named, beartype runs in a context of its
own, in which an axis has one size.
"""

import functools
import inspect
from contextlib import suppress
from typing import Any, get_args, get_type_hints

import jaxtyping
from jaxtyping import AbstractArray

_THEIRS = jaxtyping.jaxtyped


def checked(fn: Any = None, *, typechecker: Any) -> Any:
    """Takes the place of `jaxtyping.jaxtyped`, which the import hook puts on every function."""
    if fn is None:
        return functools.partial(checked, typechecker=typechecker)
    if inspect.isclass(fn):
        return _THEIRS(fn, typechecker=typechecker)
    if isinstance(fn, (classmethod, staticmethod)):
        return type(fn)(checked(fn.__func__, typechecker=typechecker))
    if isinstance(fn, property):
        parts = (fn.fget, fn.fset, fn.fdel)
        return property(*(part and checked(part, typechecker=typechecker) for part in parts))
    if inspect.isgeneratorfunction(fn):  # beartype would look at its arguments at the first step
        return _THEIRS(fn, typechecker=typechecker)
    hints = {name: _known(hint, fn) for name, hint in fn.__annotations__.items()}
    fn.__annotations__ = hints
    plain = typechecker(fn)
    if not any(_names_array(hint) for hint in hints.values()):
        return plain

    @functools.wraps(fn)
    def within_context(*args, **kwargs):
        with _THEIRS("context"):
            return plain(*args, **kwargs)

    return within_context


def _known(hint, fn):
    """The hint with what its strings name, or anything where nobody can know that yet."""

    def holder(value): ...

    holder.__annotations__ = {"value": hint}
    with suppress(NameError):
        return get_type_hints(holder, fn.__globals__, include_extras=True)["value"]
    return Any


def _names_array(hint):
    if inspect.isclass(hint) and issubclass(hint, AbstractArray):
        return True
    return any(_names_array(part) for part in get_args(hint))


jaxtyping.jaxtyped = checked
