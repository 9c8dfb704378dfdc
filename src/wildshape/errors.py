# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The ways in which Wildshape refuses: one sentence that names the cause and the cure."""

import errno
from importlib import import_module
from typing import Any

_LONGEST = 1600


class BadInputError(ValueError):
    """Input that cannot be used; the message is one sentence naming the file and the cure.

    The command line prints the message alone and exits with code 2. What a file or its name brings
    into the message cannot steer a terminal or fill it: characters that are not printable are spelt
    out, and the middle of a very long message is left out.
    """

    def __init__(self, message: str) -> None:
        text = "".join(map(_visible, message))
        super().__init__(text if len(text) <= _LONGEST else f"{text[:1200]} ... {text[-300:]}")


class SharedInputError(BadInputError):
    """What all parts of a data set need cannot be used: going on to the next one is in vain."""


class LostWorkersError(BadInputError):
    """Work ended for lack of workers, not for its input: what is finished is gone on with."""


class MissingExtraError(ImportError):
    """An optional library is absent; the message names the extra that brings it."""


def load_library(name: str, purpose: str, install: str) -> Any:
    """A module of a library that is imported where it is needed and nowhere else.

    Args:
        name: of the module.
        purpose: what needs it, the beginning of the message: `meshes need scikit-image`.
        install: what brings it.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtraError(f"{purpose}, which is not installed: {install}.") from error


def _visible(character: str) -> str:
    return character if character.isprintable() else ascii(character)[1:-1]


_MEMORY_WORDS = (
    "out of memory",
    "allocate memory",
    "bad_alloc",
    "start new thread",
    "failed to map segment",
    "without exception set",  # CPython's own words where an import runs out of it
)


def lacks_memory(error: BaseException) -> bool:
    """Whether memory or threads ran out, in the words of Python, numpy, torch or the system."""
    if isinstance(error, MemoryError) or getattr(error, "errno", None) == errno.ENOMEM:
        return True
    said = str(error).lower()
    return any(words in said for words in _MEMORY_WORDS)
