# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One input read, and what was wrong with that: the rules that hold for every reader."""

import os
import re
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tests.fuzz.target import Target

from wildshape.errors import BadInputError, MissingExtraError

SECONDS = 5.0
"""Of processor time: longer is a hang, however busy the machine is."""
BYTES_FIXED, BYTES_A_BYTE, BYTES_A_POINT = 64 << 20, 10, 64
_LONGEST_MESSAGE = 2000
_ABSURD = re.compile(r"malloc of size \d{11,} failed")  # Arrow asks, and writes what there is


@dataclass(frozen=True)
class Verdict:
    """What became of an input.

    Attributes:
        failure: the rule that was broken; empty if none was.
        detail: more about the failure.
        accepted: the reader returned something.
        seconds: of processor time.
        peak: bytes above what the process held before.
    """

    failure: str
    detail: str
    accepted: bool
    seconds: float
    peak: int


class Memory:
    """This process's memory, from the kernel."""

    def __init__(self) -> None:
        self._status = os.open("/proc/self/status", os.O_RDONLY)
        self._reset = os.open("/proc/self/clear_refs", os.O_WRONLY)

    def restart(self) -> int:
        """Forget the peak; returns the bytes held now."""
        os.write(self._reset, b"5")
        return self._field(b"VmRSS:")

    def peak(self) -> int:
        """The most bytes held since."""
        return self._field(b"VmHWM:")

    def _field(self, name: bytes) -> int:
        text = os.pread(self._status, 4096, 0)
        return int(text[text.index(name) + len(name) :].split(maxsplit=1)[0]) << 10


class Judge:
    """Reads inputs in this process, whose stderr it holds."""

    def __init__(self, printed: Path) -> None:
        """Everything that is printed goes to a file from now on."""
        self._memory = Memory()
        self._printed = os.open(printed, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND)
        os.dup2(self._printed, 1)
        os.dup2(self._printed, 2)

    def judge(self, target: Target, folder: Path, size: int) -> Verdict:
        """Read what lies in a folder, of `size` bytes in all."""
        held, start = self._memory.restart(), time.process_time()
        failure, points, accepted = _read(target, folder)
        seconds, peak = time.process_time() - start, self._memory.peak() - held
        allowed = BYTES_FIXED + max(BYTES_A_BYTE * size, BYTES_A_POINT * points)
        if not failure and seconds > SECONDS:
            failure = "hang", f"{seconds:.1f} s"
        if not failure and peak > allowed:
            failure = "memory", f"{peak >> 20} MB for {size} bytes and {points} points"
        text = self._taken()
        if not failure and text:
            failure = "printed", text
        return Verdict(*(failure or ("", "")), accepted, seconds, peak)

    def _taken(self) -> str:
        """What was printed since the last time."""
        sys.stdout.flush()
        sys.stderr.flush()
        size = os.fstat(self._printed).st_size
        if not size:
            return ""
        text = os.pread(self._printed, min(size, 4000), 0).decode(errors="replace")
        os.ftruncate(self._printed, 0)
        return text


def _read(target: Target, folder: Path) -> tuple[tuple[str, str] | None, int, bool]:
    """The failure, how many points were returned, and whether anything was."""
    points = 0
    try:
        for numbers in target.read(folder):
            if numbers is None:
                continue
            points += len(numbers) if numbers.ndim else 0
            if numbers.dtype.kind == "f" and not np.isfinite(numbers).all():
                return ("not finite", f"{numbers.shape} {numbers.dtype}"), points, True
    except (BadInputError, MissingExtraError) as error:
        return _refused(error), points, False
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001
        return ("foreign " + type(error).__name__, trace(error)), points, False
    return None, points, True


def _refused(error: Exception) -> tuple[str, str] | None:
    """What is wrong with the sentence, or with how it came about."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError) and not _ABSURD.search(str(cause)):
            return "memory", "asked for more than there may be: " + trace(cause)
        cause = cause.__cause__ or cause.__context__
    text = str(error)
    if not text.strip() or len(text) > _LONGEST_MESSAGE:
        return "message", f"of {len(text)} characters: {text[:200]!r}"
    if not text.isprintable():
        return "message", f"with characters that cannot be printed: {text[:400]!r}"
    return None


def trace(error: BaseException) -> str:
    """The type, the message and where, in one line; our own lines and the last."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if "/wildshape/" in f.filename or "/tests/fuzz/" in f.filename]
    shown = dict.fromkeys(f"{f.filename.rpartition('/')[2]}:{f.lineno}" for f in ours[-3:])
    shown |= dict.fromkeys(f"{f.filename.rpartition('/')[2]}:{f.lineno}" for f in frames[-1:])
    return f"{type(error).__name__}: {str(error)[:200]!r} at {' < '.join(reversed(shown))}"
