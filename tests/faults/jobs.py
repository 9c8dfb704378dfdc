# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The commands that are disturbed, on tiny inputs, and what of their work counts as finished."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from shutil import copytree
from typing import Any

from tests.faults.content import content, differences, under_final_names
from tests.faults.process import Ended, warm

TRACKS, SCANS = 6, 4
_UNITS: dict[str, str] = {  # a file that says that all beside and below it is finished
    "complete": "objects.json",
    "convert": "part.json",
    "simulate": "track.json",
}


@dataclass
class Job:
    """A command line but for its output.

    Attributes:
        command: its name.
        label: which kind of it.
        line: the command line for an output.
        changing: files that are replaced on the way: whole at any time, but not yet the last.
        expected: content of the undisturbed output.
        seconds: how long an undisturbed run takes.
        peak_bytes: the most address space that it needs.
        writes_bytes: the size of its output.
    """

    command: str
    label: str
    line: Callable[[Path], list[str]]
    changing: tuple[str, ...] = ("wildshape.json",)
    expected: dict[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    peak_bytes: int = 0
    writes_bytes: int = 0

    def again(self, out: Path) -> list[str]:
        """The command that goes on."""
        return self.line(out) + (["--resume"] if self.command == "train" else [])

    def measure(self, out: Path) -> None:
        """Run it undisturbed, twice: the first run still imports, and both must say the same."""
        again = out.with_name(f"{out.name}-again")
        for place in (again, out):
            ended = warm(self.line(place)).end()
            if ended.code:
                raise RuntimeError(f"{self.label}: {ended.said}")
            self.seconds, self.peak_bytes = ended.seconds, ended.peak_bytes
        self.expected = content(out)
        if found := differences(content(again), self.expected):
            raise RuntimeError(f"{self.label}: does not repeat itself: {found}")
        self.writes_bytes = sum(f.stat().st_size for f in out.rglob("*") if f.is_file())

    def finished(self, out: Path) -> set[tuple[int, int]]:
        """Inode and time of each file of finished work: these very files must stay."""
        last = _UNITS.get(self.command)
        if last is None:
            return set()
        if "--drive" in self.label:  # every scan is finished work
            scans = under_final_names(out).values()
            return {_identity(scan) for scan in scans if scan.suffix == ".bin"}
        folders = [file.parent for file in out.rglob(last) if _whole(file, out)]
        files = [f for folder in folders for f in folder.rglob("*") if f.is_file()]
        kept = [f for f in files if f.suffix in (".ply", ".txt") or f.name.startswith("points-")]
        return {_identity(file) for file in kept}


def _identity(file: Path) -> tuple[int, int]:
    return file.stat().st_ino, file.stat().st_mtime_ns


def _whole(file: Path, out: Path) -> bool:
    """Whether a unit has its name: those in `.parts` do, those still being written do not."""
    parts = file.relative_to(out).parts[:-1]
    return not any(p.startswith(".") and p != ".parts" for p in parts)


def done_already(ended: Ended) -> bool:
    """Whether a command refused because its output is finished."""
    return ended.code == 2 and ("earlier" in ended.said or "is there already" in ended.said)


def steps_saved(out: Path) -> int:
    """The step of a training run's saved state; 0 without one."""
    from tests.faults.content import read

    name = "state.safetensors"
    return int(read(out / name)["step"]) if name in under_final_names(out) else 0


def _drive(out: Path) -> list[str]:
    return ["simulate", str(out), "--drive", "--scans", "3", "--sensor", "hdl32"]


def make_jobs(folder: Path) -> list[Job]:
    """The inputs, made by the commands themselves, and the jobs on them."""
    store, tracks, model = folder / "cars.store", folder / "cars", folder / "model"
    few = folder / "few"
    train = ("--preset", "tiny", "--device", "cpu")
    made = "--tracks", str(TRACKS), "--scans", str(SCANS), "--seed", "3", "--workers", "1"
    for line in (
        ["simulate", str(store), *made],
        ["simulate", str(tracks), *made, "--layout", "folders"],
        ["train", str(store), "--out", str(model), *train],
    ):
        ended = warm(line).end()
        if ended.code:
            raise RuntimeError(f"{line}: {ended.said}")

    for name in sorted(file.name for file in tracks.iterdir() if file.is_dir())[:2]:
        copytree(tracks / name, few / name)

    def simulate(*more: str) -> Callable[[Path], list[str]]:
        return lambda out: ["simulate", str(out), *made, *more]

    def convert(*more: str) -> Callable[[Path], list[str]]:
        return lambda out: ["convert", "folder", str(tracks), str(out), *more]

    def complete(data: Path, *more: str) -> Callable[[Path], list[str]]:
        return lambda out: [
            *("complete", str(data), "--out", str(out), "--model", str(model), *more)
        ]

    def trained(data: Path, *more: str) -> Callable[[Path], list[str]]:
        return lambda out: ["train", str(data), "--out", str(out), *train, *more]

    alone, state = ("--workers", "1"), ("wildshape.json", "model.safetensors", "state.safetensors")
    growing = (*state, "log.jsonl")
    return [
        Job("train", "train", trained(store), growing),
        Job("train", "train folders", trained(tracks), growing),
        Job("train", "train --teacher", trained(store, "--teacher", str(model)), growing),
        Job("convert", "convert packed", convert(*alone)),
        Job("convert", "convert folders", convert(*alone, "--layout", "folders")),
        Job("complete", "complete", complete(tracks, "--boxes", "json,kitti", *alone)),
        Job("complete", "complete --track", complete(few, "--track", *alone)),
        Job("simulate", "simulate packed", simulate()),
        Job("simulate", "simulate folders", simulate("--layout", "folders")),
        Job("simulate", "simulate --drive", _drive),
    ]
