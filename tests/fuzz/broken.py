# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Readers that break each of the rules: the fuzzer must find them all."""

import os
import sys
import warnings
from pathlib import Path

import numpy as np
from tests.fuzz.target import Arrays, Target

from wildshape.errors import BadInputError

_VALID = b"16 valid bytes.."


def _build(folder: Path) -> None:
    (folder / "valid").mkdir(parents=True)
    (folder / "valid" / "scan.bin").write_bytes(_VALID)


def _is_valid(folder: Path) -> bool:
    path = folder / "scan.bin"
    return path.is_file() and path.read_bytes() == _VALID


def _raises(folder: Path) -> Arrays:
    yield np.ones(3) if _is_valid(folder) else np.ones(3)[5:6].reshape(7)


def _crashes(folder: Path) -> Arrays:
    if not _is_valid(folder):
        os.abort()
    yield np.ones(3)


def _hangs(folder: Path) -> Arrays:
    while not _is_valid(folder):
        pass
    yield np.ones(3)


def _eats(folder: Path) -> Arrays:
    yield np.ones(3) if _is_valid(folder) else np.ones((100, 200_000))[:, 0]


def _asks(folder: Path) -> Arrays:
    if not _is_valid(folder):
        try:
            np.empty(1 << 40)
        except MemoryError as error:
            raise BadInputError(f"{folder}: damaged; copy it again.") from error
    yield np.ones(3)


def _prints(folder: Path) -> Arrays:
    if not _is_valid(folder):
        print("here I am", file=sys.stderr)
    yield np.ones(3)


def _warns(folder: Path) -> Arrays:
    if not _is_valid(folder):
        warnings.warn("divided by zero", RuntimeWarning, stacklevel=1)
    yield np.ones(3)


def _infinite(folder: Path) -> Arrays:
    yield np.ones(3) if _is_valid(folder) else np.array([1.0, np.inf])


def _mute(folder: Path) -> Arrays:
    if not _is_valid(folder):
        raise BadInputError("")
    yield np.ones(3)


def _right(folder: Path) -> Arrays:
    if not _is_valid(folder):
        raise BadInputError(f"{folder}: no scan; copy it again.")
    yield np.ones(3)


TARGETS = (
    Target("raises", _build, _raises),
    Target("crashes", _build, _crashes),
    Target("hangs", _build, _hangs),
    Target("eats", _build, _eats),
    Target("asks", _build, _asks),
    Target("prints", _build, _prints),
    Target("warns", _build, _warns),
    Target("infinite", _build, _infinite),
    Target("mute", _build, _mute),
    Target("right", _build, _right),
)
