# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Ouster's packets, decoded by its own SDK."""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Int

from wildshape.errors import load_library
from wildshape.io.guard import reading
from wildshape.io.packets.clock import gone_on, set_told
from wildshape.io.progress import counted
from wildshape.records import Turn

_INSTALL = "pip install 'wildshape[ouster]'"
_WHOLE = 0.9  # of the columns that the sensor was told to send in a turn
_S_PER_NS = 1e-9


@dataclass(frozen=True)
class OusterTurns:
    """The turns of a recording, in time order.

    Attributes:
        described: what the sensor says of itself, JSON.
        times: of each turn's first column, on the sensor's clock, seconds; they go on where it
            was set.
        warnings: what is odd about it, a sentence each.
    """

    path: Path
    described: Path
    times: tuple[float, ...]
    warnings: tuple[str, ...]
    numbers: tuple[int, ...] = field(repr=False)

    def __call__(self, number: int) -> Turn:
        """The points of a turn that have a return, and when each was taken.

        Raises:
            Exception: damaged.
        """
        source, places = _opened(self.path, self.described)
        frame = source[self.numbers[number]][0]
        returned = (frame.field("RANGE") > 0) & _columns(frame)
        since = (frame.timestamp - frame.timestamp[_columns(frame)].min()) * _S_PER_NS
        seconds = np.broadcast_to(since, returned.shape)
        return Turn(places(frame)[returned].astype(np.float32), seconds[returned])


def open_ouster(path: Path, described: Path) -> OusterTurns:
    """List the turns of a recording.

    Raises:
        BadInputError: no such recording.
        MissingExtraError: ouster-sdk is not installed.
    """
    _library("pcap")
    with reading(path, f"Ouster's packets of the sensor of {described.name}"):
        source, _ = _opened(path, described)
        window = getattr(source.sensor_info[0].format, "column_window", None)
        times, numbers, recorded = [], [], []
        for number, (frame, *_) in enumerate(source):
            there = _columns(frame)
            if there[columns_sent(window, len(there))].mean() >= _WHOLE:
                times.append(float(frame.timestamp[there].min()) * _S_PER_NS)
                numbers.append(number)
                recorded.append(int(frame.packet_timestamp.max()) // 1000)
        left = len(source) - len(numbers)
    told = [f"{counted(left, 'turn')} with missing packets left out"] if left else []
    gone, by_s = gone_on(times, recorded)
    told += set_told(f"the sensor's clock in {path.name}", by_s)
    return OusterTurns(path, described, gone, tuple(told), tuple(numbers))


def columns_sent(window: tuple[int, int] | None, count: int) -> Int[np.ndarray, "n"]:
    """The columns of a turn that a sensor sends.

    Args:
        window: the first and the last that it was told to send; past the last column it goes on
            with the first. None: all.
        count: of a turn's columns.
    """
    first, last = window or (0, count - 1)
    return (first + np.arange((last - first) % count + 1)) % count


def _columns(frame: Any) -> Bool[np.ndarray, "w"]:
    """Those whose packets are there."""
    return (frame.status & 1) > 0


@lru_cache(maxsize=1)
def _opened(path: Path, described: Path) -> tuple[Any, Any]:
    """The frames of a recording, and what gives their points."""
    source = _library("pcap").PcapFrameSetSource(str(path), meta=[str(described)], index=True)
    return source, _library("core").XYZLut(source.sensor_info[0])


def _library(part: str) -> Any:
    return load_library(f"ouster.sdk.{part}", "packets of Ouster need ouster-sdk", _INSTALL)
