# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One fault on one job: what is broken, and what must hold afterwards."""

import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from tests.faults.content import content, differences, read, under_final_names
from tests.faults.jobs import Job, done_already, steps_saved
from tests.faults.process import Blow, Ended, cold, warm, workers_gone

Fault = Callable[[Job, Path, Random, float], str]
"""Disturbs a job that writes to a path, at a share of its length; says how it went."""


class BrokenPromiseError(AssertionError):
    """Something that must hold did not."""


def promise(kept: object, sentence: str) -> None:
    """Raise unless it is kept."""
    if not kept:
        raise BrokenPromiseError(sentence)


def kill(job: Job, out: Path, random: Random, share: float) -> str:
    """SIGKILL, then the same command, which may be killed again, until it is done."""
    ended = warm(job.line(out)).end(Blow(signal.SIGKILL, share * job.seconds))
    kills = int(ended.code == -signal.SIGKILL)
    if kills and random.random() < 0.3:
        _after(job, out)
        steps = steps_saved(out)
        again = warm(job.again(out)).end(Blow(signal.SIGKILL, random.random() * job.seconds))
        kills += again.code == -signal.SIGKILL
        promise(steps_saved(out) >= steps, "the saved state went back")
    resumed(job, out)
    return f"killed {kills} times" if kills else "ended before"


def kill_cold(job: Job, out: Path, random: Random, share: float) -> str:
    """The same with a fresh interpreter, and with workers where the command takes them."""
    line = [
        word if word != "1" or "--workers" not in job.line(out) else "2" for word in job.line(out)
    ]
    after = 2.5 + share * (job.seconds + 2.0)
    process = cold(line, _usual())
    ended = process.end(Blow(signal.SIGKILL, after))
    promise(workers_gone(process.pid), "workers outlive the command")
    resumed(job, out)
    return "killed 1 times" if ended.code == -signal.SIGKILL else "ended before"


def terminate(job: Job, out: Path, random: Random, share: float) -> str:
    """SIGTERM: one sentence, exit code 143."""
    ended = warm(job.line(out)).end(Blow(signal.SIGTERM, share * job.seconds))
    if ended.code != -signal.SIGTERM:  # before the command had begun
        promise(ended.code in (0, 143), f"exit code {ended.code} after SIGTERM: {ended.said}")
        one_sentence(ended)
    resumed(job, out)
    return "stopped" if ended.code == 143 else "ended before"


def fill(job: Job, out: Path, random: Random, share: float) -> str:
    """A disk too small for the output, then a larger one."""
    size = max(8192, int(share * job.writes_bytes))
    with _small_disk(out.parent, size) as disk:
        ended = warm(job.line(out), disk.limit).end()
        promise(
            ended.code in (0, 1), f"exit code {ended.code} where the disk was full: {ended.said}"
        )
        one_sentence(ended)
        disk.enlarge()
        resumed(job, out)
    return "full" if ended.code else "ended before"


def starve(job: Job, out: Path, random: Random, share: float) -> str:
    """Less address space than the command needs (`ulimit -v`), then as much as it wants."""
    base = _address_space()
    most = base + int(share * max(job.peak_bytes - base, 1 << 20))
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most))  # noqa: E731
    ended = warm(job.line(out), limit).end()
    if _crashed_in_a_library(ended):
        resumed(job, out)
        return "crashed in a library"
    promise(ended.code in (0, 1, 2), f"exit code {ended.code} without memory: {ended.said}")
    one_sentence(ended)
    resumed(job, out)
    return "starved" if ended.code else "ended before"


def _crashed_in_a_library(ended: Ended) -> bool:
    """Whether code that checks no allocation ended it, or the dynamic linker, which gives up."""
    linker = "cannot allocate memory for thread-local data: ABORT"  # glibc's dl-tls.c, with 127
    gave_up = ended.code == 127 and ended.said.rstrip().endswith(linker)
    return gave_up or ended.code in (-signal.SIGSEGV, -signal.SIGABRT)


def forbid(job: Job, out: Path, random: Random, share: float) -> str:
    """A folder that may not be written; a half-finished output that may not be; then it may."""
    with _small_disk(out.parent, 64 << 20) as disk:
        with disk.read_only():
            ended = _refused(job.line(out))
            promise("read-only" in ended.said or "permission" in ended.said, ended.said)
            promise(not out.exists(), "something was written")
        warm(job.line(out)).end(Blow(signal.SIGKILL, share * job.seconds))
        with disk.read_only():
            _refused(job.again(out))
        resumed(job, out)
    return "refused"


def _refused(line: list[str]) -> Ended:
    ended = warm(line).end()
    promise(ended.code == 2, f"exit code {ended.code} in a read-only folder: {ended.said}")
    one_sentence(ended)
    return ended


def write_twice(job: Job, out: Path, random: Random, share: float) -> str:
    """Two processes on one output: one does the work, the other is refused or comes too late."""
    first = warm(job.line(out))
    second = warm(job.again(out) if share > 0.5 else job.line(out), _sleep(share * job.seconds))
    ends = first.end(), second.end()
    for ended in ends:
        promise(ended.code in (0, 2), f"exit code {ended.code} of two writers: {ended.said}")
        one_sentence(ended)
    promise(any(ended.code == 0 for ended in ends), f"neither did it: {[e.said for e in ends]}")
    _after(job, out)
    found = differences(content(out), job.expected)
    promise(not found, f"two writers made other content: {found}")
    return "refused" if any(ended.code for ended in ends) else "both ended"


def homeless(job: Job, out: Path, random: Random, share: float) -> str:
    """A fresh interpreter without HOME, or with one that cannot be written."""
    home = random.choice(({}, {"HOME": "/proc/none"}, {"HOME": "/proc"}))
    ended = cold(job.line(out), {"PATH": os.defpath, **home}).end()
    return _same(job, out, ended, f"with {home or 'no HOME'}")


def toolless(job: Job, out: Path, random: Random, share: float) -> str:
    """A fresh interpreter that finds no compiler, nor any other program."""
    ended = cold(job.line(out), {"PATH": "", "CC": "none", "HOME": "/tmp"}).end()
    return _same(job, out, ended, "without a compiler")


def _same(job: Job, out: Path, ended: Ended, how: str) -> str:
    promise(ended.code == 0, f"exit code {ended.code} {how}: {ended.said}")
    one_sentence(ended)
    found = differences(content(out), job.expected)
    promise(not found, f"other content {how}: {found}")
    return "the same"


def resumed(job: Job, out: Path) -> None:
    """Repeat the command: nothing finished is lost, and the result is the undisturbed one."""
    _after(job, out)
    finished = job.finished(out) if out.exists() else set()
    ended = warm(job.again(out)).end()
    promise(ended.code == 0 or done_already(ended), f"does not go on ({ended.code}): {ended.said}")
    one_sentence(ended)
    lost = finished - {(f.stat().st_ino, f.stat().st_mtime_ns) for f in out.rglob("*")}
    promise(not lost, f"{len(lost)} of {len(finished)} finished files were made again")
    found = differences(content(out), job.expected)
    promise(not found, f"other content than undisturbed: {found}")


def _after(job: Job, out: Path) -> None:
    """Under final names there are whole files alone; those that do not change are the last."""
    for name, file in under_final_names(out).items():
        if name == "log.jsonl":  # grows line by line; its reader drops a torn last one
            continue
        try:
            found = read(file)
        except Exception as error:
            raise BrokenPromiseError(f"{name} is torn ({error!r})") from error
        if name in job.expected and name not in job.changing:
            promise(found == job.expected[name], f"{name} is not whole under its final name")


def one_sentence(ended: Ended) -> None:
    """No traceback; what ends a command is one line."""
    promise("Traceback" not in ended.said, f"a traceback: {ended.said}")
    promise("Warning" not in ended.said, f"a warning: {ended.said}")
    if ended.code:
        last = ended.said.strip().splitlines()[-1:]
        promise(last and last[0].startswith("wildshape: "), f"no sentence: {ended.said!r}")
        promise(ended.said.count("wildshape: ") == 1, f"more than one sentence: {ended.said}")


def _usual() -> dict[str, str]:
    return {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/tmp")}


def _sleep(seconds: float) -> Callable[[], None]:
    from time import sleep

    return lambda: sleep(seconds)


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


@dataclass(frozen=True)
class Disk:
    """A folder with little room: a tmpfs for root, else a folder in which files stay short."""

    place: Path
    mounted: bool
    short: int

    def limit(self) -> None:
        """For a child that writes there."""
        if not self.mounted:
            resource.setrlimit(resource.RLIMIT_FSIZE, (self.short, self.short))

    def enlarge(self) -> None:
        """Make room."""
        if self.mounted:
            _mount(self.place, "remount,size=64m")

    @contextmanager
    def read_only(self) -> Iterator[None]:
        """Inside nothing can be written."""
        if self.mounted:
            _mount(self.place, "remount,ro")
        folders = [] if self.mounted else [self.place, *_folders(self.place)]
        for folder in folders:
            folder.chmod(0o555)
        try:
            yield
        finally:
            for folder in folders:
                folder.chmod(0o755)
            if self.mounted:
                _mount(self.place, "remount,rw")


@contextmanager
def _small_disk(place: Path, size: int) -> Iterator[Disk]:
    disk = Disk(place, mounts(place), size // 4)
    if disk.mounted:
        _mount(place, f"size={size}")
    try:
        yield disk
    finally:
        if disk.mounted:
            subprocess.run(["umount", str(place)], check=True)


def _folders(place: Path) -> list[Path]:
    return [path for path in place.rglob("*") if path.is_dir()]


def _mount(place: Path, options: str) -> None:
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(place)]
    subprocess.run(command, check=True, capture_output=True)


def mounts(place: Path) -> bool:
    """Whether this user may mount a small disk."""
    if os.geteuid() or not shutil.which("mount"):
        return False
    try:
        _mount(place, "size=64k")
    except subprocess.CalledProcessError:
        return False
    subprocess.run(["umount", str(place)], check=True)
    return True
