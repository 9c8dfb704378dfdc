# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Random numbers as a pure function of (seed, process, step, lane), drawn where the step lies.

One SplitMix64 sequence a run and process, of which each step reads a stretch of its own. There is
no state to keep, save or capture: the step is a tensor, so a CUDA graph that is replayed with
another step draws other numbers. Integer arithmetic alone: the same bits on every device.
"""

import torch
from jaxtyping import Float32, Int64
from torch import Tensor

# SplitMix64 (Steele, Lea and Flood 2014): a counter in odd strides, and a finaliser that mixes it.
_STRIDE, _MIX1, _MIX2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
_WORD = (1 << 64) - 1


def random_bits(
    seed: int, process: int, step: Int64[Tensor, ""], count: int
) -> Int64[Tensor, "count"]:
    """`count` lanes of 32 random bits, in `[0, 2^32)`.

    Args:
        seed: of the run.
        process: number of the process.
        step: scalar on the device where the numbers are drawn, from 0 to 2^31.
        count: lanes, fewer than 2^32; a lane's number does not depend on it.
    """
    key = _mixed(_mixed(seed + _STRIDE) + process)
    place = (step << 32) + torch.arange(1, count + 1, device=step.device)
    return _mix(place * _signed(_STRIDE) + _signed(key)) >> 32 & 0xFFFFFFFF


def uniform(bits: Int64[Tensor, "*any"]) -> Float32[Tensor, "*any"]:
    """Evenly in `[0, 1)`, multiples of 2^-24."""
    return (bits >> 8).to(torch.float32) * 2.0**-24


def integers(bits: Int64[Tensor, "*any"], end: int | Tensor) -> Int64[Tensor, "*any"]:
    """Evenly in `[0, end)`, `end` at most 2^31 and broadcast."""
    return bits * end >> 32


def _mix(x: Tensor) -> Tensor:
    """The finaliser on int64, whose products wrap around like those of 64 unsigned bits."""
    x = (x ^ _shifted(x, 30)) * _signed(_MIX1)
    x = (x ^ _shifted(x, 27)) * _signed(_MIX2)
    return x ^ _shifted(x, 31)


def _shifted(x: Tensor, by: int) -> Tensor:
    """Shifted right, zeros coming in."""
    return x >> by & (_WORD >> by)


def _mixed(x: int) -> int:
    x &= _WORD
    x = (x ^ x >> 30) * _MIX1 & _WORD
    x = (x ^ x >> 27) * _MIX2 & _WORD
    return x ^ x >> 31


def _signed(word: int) -> int:
    """The int64 of the same 64 bits."""
    return word - (1 << 64) if word >> 63 else word
