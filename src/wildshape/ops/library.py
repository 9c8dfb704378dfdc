# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The compiled C kernels, if the build made them for this machine; else None, silently."""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import torch

from wildshape.errors import BadInputError, lacks_memory

_ABI = 2
WIDEST = -1  # the `level` of a kernel: the widest instructions that this processor has
_PATH = Path(__file__).parent / "native" / "libwildshape_ops.so"

_P, _I64, _INT = ctypes.c_void_p, ctypes.c_int64, ctypes.c_int
_F32, _F64 = ctypes.c_float, ctypes.c_double
_SIGNATURES = {
    "wildshape_abi": ([], _INT),
    "wildshape_level": ([], _INT),
    "wildshape_nearest": (
        [_P, _I64, _P, _P, _I64, _P, _I64, _I64, _I64, _P, _P, _P, _P, _INT, _INT],
        _INT,
    ),
    "wildshape_nearest_gradient": (
        [_P, _I64, _P, _I64, _P, _P, _P, _I64, _I64, _I64, _P, _P, _INT],
        None,
    ),
    "wildshape_column_argmax": ([_P, _I64, _I64, _P, _INT], None),
    "wildshape_visible": ([_P, _P, _I64, _I64, _I64, _P, _INT], _INT),
}

# Added to the others, so a library built before them lacks these; each returns an int.
_ADDED: dict[str, tuple[Any, ...]] = {
    "nearest_k": (_P, _P, _P, _P, _P, _P, _I64, _I64, _I64, _I64, _F32, _P, _P, _INT, _INT),
    "parts": (_P, _I64, _F32, _F32, _P, _I64, _P),
    "cells": (_P, _I64, _F32, _P),
    "spans": (_P, _I64, _P, _I64, _P, _P),
    "planes": (_P, _P, _I64, _I64, _P, _P),
    "point_to_plane": (_P, _P, _I64, _I64, _P, _P, _P, _F64, _F64, _P, _P, _P),
}


@cache
def library() -> ctypes.CDLL | None:
    """The kernels, or None where they are absent, do not load or are of another version.

    Raises:
        MemoryError: there is no room to load them; other kernels would round otherwise.
    """
    try:
        loaded = ctypes.CDLL(str(_PATH))
        for name, (arguments, result) in _SIGNATURES.items():
            function = getattr(loaded, name)
            function.argtypes, function.restype = arguments, result
    except (OSError, AttributeError) as error:
        if lacks_memory(error):
            raise MemoryError(str(error)) from error
        return None
    return loaded if loaded.wildshape_abi() == _ABI else None


@cache
def added_kernel(name: str) -> Callable[..., int] | None:
    """One of `_ADDED`; None where the library is absent or was built before it."""
    kernel = getattr(library(), f"wildshape_{name}", None)
    if kernel is not None:
        kernel.argtypes, kernel.restype = _ADDED[name], _INT
    return kernel


def check_memory(name: str, tensor: torch.Tensor, expected: torch.dtype) -> None:
    """Refuse what the kernels cannot read: they take addresses on trust.

    Raises:
        BadInputError: another type, or not in this machine's memory.
    """
    if tensor.dtype != expected or tensor.device.type != "cpu":
        raise BadInputError(
            f"{name}: the native kernel takes {expected} on the CPU, found {tensor.dtype} on"
            f" {tensor.device}."
        )
