# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Commands as processes of their own: forked from this one, warm, or started anew, cold.

A fork has all imports done, which cost seconds: what is left is the command. This process starts
no thread and computes nothing with torch, so that its forks are sound.
"""

import faulthandler
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory

from wildshape.cli.main import main

ROOT = Path(__file__).parents[2]
PATIENCE_S = 60.0


@dataclass(frozen=True)
class Ended:
    """What became of a process: exit code (minus a signal's number), stderr, seconds, memory."""

    code: int
    said: str
    seconds: float
    peak_bytes: int = 0


@dataclass(frozen=True)
class Blow:
    """A signal, sent so long after the start."""

    signal: signal.Signals
    after_s: float


class Process:
    """A command that runs; `end` waits for it."""

    def __init__(self, pid: int, folder: "TemporaryDirectory[str]") -> None:
        self.pid, self._folder = pid, folder
        self._began = time.monotonic()

    def end(self, blow: Blow | None = None) -> Ended:
        """Wait, striking on the way; whoever hangs is killed and said to hang."""
        if blow is not None:
            time.sleep(max(0.0, self._began + blow.after_s - time.monotonic()))
            os.kill(self.pid, blow.signal)
        status = self._status()
        seconds = time.monotonic() - self._began
        file = Path(self._folder.name)
        said = (file / "stderr").read_text("utf-8", errors="replace")
        peak = (file / "peak").read_text() if (file / "peak").exists() else "0"
        if blow is None and (file / "modules").exists():
            _import_too((file / "modules").read_text().splitlines())
        self._folder.cleanup()
        return Ended(os.waitstatus_to_exitcode(status), said, seconds, int(peak or 0))

    def _status(self) -> int:
        while time.monotonic() - self._began < PATIENCE_S:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return status
            time.sleep(0.001)
        os.kill(self.pid, signal.SIGABRT)  # says where it hangs
        os.waitpid(self.pid, 0)
        said = (Path(self._folder.name) / "stderr").read_text("utf-8", errors="replace")
        raise TimeoutError(f"the command hangs: {said}")


def warm(arguments: Sequence[str], before: Callable[[], None] = lambda: None) -> Process:
    """Fork and run a command; `before` is called in the child."""
    folder = TemporaryDirectory(prefix="faults-")
    (Path(folder.name) / "stderr").touch()  # a child may be killed before it opens its own
    pid = os.fork()
    if pid == 0:
        _child(arguments, Path(folder.name), before)
    return Process(pid, folder)


def cold(arguments: Sequence[str], environment: dict[str, str]) -> Process:
    """Start an interpreter, with this environment alone."""
    folder = TemporaryDirectory(prefix="faults-")
    command = [sys.executable, "-m", "tests.faults.small", *arguments]
    with (Path(folder.name) / "stderr").open("wb") as said:
        process = subprocess.Popen(
            command,
            env={"PYTHONPATH": f"{ROOT}:{ROOT / 'src'}", "OMP_NUM_THREADS": "1", **environment},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=said,
            cwd=ROOT,
            start_new_session=True,
        )
    process.returncode = 0  # we wait ourselves
    return Process(process.pid, folder)


def workers_gone(session: int) -> bool:
    """Whether what a killed process had started ends, too; seen in a moment, not at once."""
    ends = time.monotonic() + PATIENCE_S
    while members := _in_session(session):
        if time.monotonic() > ends:
            for pid in members:
                os.kill(pid, signal.SIGKILL)
            return False
        time.sleep(0.01)
    return True


def _in_session(session: int) -> list[int]:
    """The processes of a session that are not zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, its_session = stat.read_text().rpartition(")")[2].split()[:4]
            if int(its_session) == session and state not in "ZX":
                found.append(int(stat.parent.name))
    return found


def _import_too(names: Sequence[str]) -> None:
    """What a command imported on its way: later forks have it already."""
    for name in names:
        if name not in sys.modules and not name.startswith(("torch._", "__")):
            with suppress(Exception):
                import_module(name)


def _child(arguments: Sequence[str], folder: Path, before: Callable[[], None]) -> None:
    """Never returns: nothing of the parent's may run twice."""
    code = 70
    try:
        for number, name in ((1, "stdout"), (2, "stderr")):
            file = os.open(folder / name, os.O_WRONLY | os.O_CREAT, 0o666)
            os.dup2(file, number)
        peak = (folder / "peak").open("w")
        faulthandler.enable()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        sys.argv = ["wildshape", *arguments]
        before()
        code = _code(arguments)
        peak.write(str(_peak_bytes()))
        peak.close()
        (folder / "modules").write_text("\n".join(sys.modules))
    finally:
        sys.stderr.flush()
        os._exit(code)


def _code(arguments: Sequence[str]) -> int:
    try:
        main(arguments)
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except BaseException:  # noqa: BLE001
        traceback.print_exc()
        return 1
    return 0


def _peak_bytes() -> int:
    """The most address space that this process had."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith("VmPeak"))
