# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a reader costs on a file: memory over the process's own, processor time, its answer.

A process imports the reader once and forks for each file: a file that kills, hangs or fills its
process does nothing to the next one, nor to the tests.

The rule for every reader: at most ten times the file's size, or 64 bytes for each point that the
file really holds, and 64 MB; a time that is linear in it.
"""

import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]
_FREE_BYTES = 64_000_000
_SIZE, _SHARED = 0, 2  # in /proc/self/statm: all that is mapped; what files are behind
_SPACE_BYTES = 4 << 30  # what a process may map: the machine is safe from any reader


@dataclass(frozen=True)
class Cost:
    """What reading one file took.

    Attributes:
        grown: bytes of memory at the peak, over what the process had before.
        cpu_s: seconds of processor time.
        points: how many things were read (`len`), 0 where it was refused.
        error: type and text of what was raised; `killed by signal N` for the worst.
    """

    grown: int
    cpu_s: float
    points: int
    error: str

    @property
    def is_answer(self) -> bool:
        """Whether it was read, or refused in one sentence."""
        return self.error == "" or (self.error.startswith("BadInputError: ") and self.is_one_line)

    @property
    def is_one_line(self) -> bool:
        """Whether what was said is one line."""
        return "\n" not in self.error


def allowed(path: Path, points: int = 0) -> int:
    """Bytes that reading a file, or all files of a folder, may take."""
    files = [f for f in path.rglob("*") if f.is_file()] if path.is_dir() else [path]
    return max(10 * sum(f.stat().st_size for f in files), 64 * points) + _FREE_BYTES


def costs(reader: str, paths: Sequence[Path], cpu_s: int = 20) -> list[Cost]:
    """Each path read in a process of its own, under limits.

    Args:
        reader: `module:function` of one argument, a Path.
        paths: files or folders.
        cpu_s: processor time after which a process is killed.
    """
    command = [sys.executable, "-m", "tests.io.limits", reader, str(cpu_s)]
    sent = "".join(f"{path}\n" for path in paths)
    alone = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        command, input=sent, text=True, stdout=-1, check=True, env=alone, cwd=_ROOT
    )
    return [Cost(**json.loads(line)) for line in done.stdout.splitlines()]


def read_within_limits(reader: str, paths: Sequence[Path], cpu_s: int = 20) -> set[str]:
    """Check that no path costs more than it holds, as `costs` reads them; names of those read."""
    found = list(zip(paths, costs(reader, paths, cpu_s)))
    for path, cost in found:
        assert cost.is_answer, (path, cost)
        assert cost.grown < allowed(path, cost.points), (path, cost)
    return {path.name for path, cost in found if cost.points}


def _serve(reader: str, cpu_s: int) -> None:
    module, _, name = reader.partition(":")
    read = getattr(import_module(module), name)
    for line in sys.stdin:
        receive, send = os.pipe()
        child = os.fork()
        if not child:
            os.dup2(2, 1)  # what a library prints is no answer of ours
            os.write(send, json.dumps(asdict(_cost(read, Path(line[:-1]), cpu_s))).encode())
            os._exit(0)
        os.close(send)
        with os.fdopen(receive, "rb") as pipe:
            answer = pipe.read()
        _, status = os.waitpid(child, 0)
        killed = asdict(Cost(0, 0.0, 0, f"killed by signal {os.waitstatus_to_exitcode(status)}"))
        print(answer.decode() or json.dumps(killed), flush=True)  # noqa: T201


def _cost(read, path: Path, cpu_s: int) -> Cost:
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    space = _mapped() + _SPACE_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (space, space))
    before, began, points, error = _own_peak(), time.process_time(), 0, ""
    try:
        points = len(read(path))
    except BaseException as raised:  # noqa: BLE001
        error = f"{type(raised).__name__}: {raised}"
    return Cost(_own_peak() - before, time.process_time() - began, points, error)


def _own_peak() -> int:
    """Bytes at the peak, without libraries' own pages.

    A fork has few of these at first, and gets as many at a touch as the kernel has at hand.
    """
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - _statm(_SHARED)


def _mapped() -> int:
    return _statm(_SIZE)


def _statm(place: int) -> int:
    """Bytes by the place of their number in `/proc/self/statm`."""
    numbers = Path("/proc/self/statm").read_text().split()
    return int(numbers[place]) * resource.getpagesize()


if __name__ == "__main__":
    _serve(sys.argv[1], int(sys.argv[2]))
