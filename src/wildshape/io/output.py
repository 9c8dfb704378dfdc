# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""An output folder and its `wildshape.json`: how it was made, and whether it is finished.

An existing output is refused; a half-finished one of the same command and settings is gone on
with; two are never mixed; `--overwrite` removes what the earlier command wrote and nothing else,
once there is what replaces it.
"""

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from wildshape.arguments import expect
from wildshape.errors import BadInputError, LostWorkersError, MissingExtraError
from wildshape.io.atomic import lock_folder, remove_leftovers_of, write_json
from wildshape.io.earlier import EARLIER, MARKER, MARKERS, MOVED, forget, put_back, set_aside
from wildshape.io.guard import reading
from wildshape.io.progress import SILENT, Progress

_LONGEST_BYTES, _SHOWN = 251, 60  # of a name before `.ply`; file systems end at 255
_RESULTS = "benchmarks/results"
_LEFTOVER = ".*.part"  # as `io/atomic.py` names what it has not finished


@dataclass(frozen=True)
class Output:
    """A folder being written.

    Attributes:
        record: what `wildshape.json` holds.
        resumed: whether finished work of an earlier, interrupted run lies in it.
    """

    path: Path
    record: dict[str, Any]
    resumed: bool = False

    @property
    def replaces(self) -> bool:
        """Whether an earlier output is set aside for it."""
        return (self.path / EARLIER).is_dir()

    def abandon(self) -> None:
        """Put back what was replaced; else leave no trace of what wrote nothing yet."""
        if put_back(self.path, self.record["files"]):
            return
        if [entry.name for entry in self.path.iterdir()] == [MARKER]:
            (self.path / MARKER).unlink()
            self.path.rmdir()

    @contextmanager
    def abandoned_if_refused(self) -> Iterator[None]:
        """`abandon`, where what is done in here is refused, but not for lack of workers."""
        try:
            yield
        except LostWorkersError:
            raise
        except (BadInputError, MissingExtraError):
            self.abandon()
            raise

    def finish(self, **more: object) -> None:
        """Say that everything is there; what it replaces goes."""
        if self.replaces:
            forget(self.path)
        write_json(self.path / MARKER, {**self.record, **more, "status": "finished"})


def begin(
    path: Path,
    command: str,
    settings: dict[str, Any],
    files: Sequence[str],
    *,
    overwrite: bool = False,
    progress: Progress = SILENT,
    line: str | None = None,
) -> Output:
    """Start, or go on with, the output of a command.

    Args:
        path: the folder.
        command: for example `complete`.
        settings: JSON values; whatever changes the content of the output.
        files: patterns of the files that the command may write below `path`.
        overwrite: replace an earlier output, which stays aside until the new one is finished.
        progress: is told that an earlier run is gone on with.
        line: how the output comes about, as a user would type it again; by default the command
            line of this process.

    Raises:
        BadInputError: something else is there, or a finished output without `overwrite`, or
            another process is writing there.
    """
    settings = json.loads(json.dumps(settings, default=str))
    expect(overwrite, bool, "overwrite", "True removes what is there")
    resumed = False
    if path.exists() and not path.is_dir():
        raise BadInputError(f"{path}: is a file; --out names a folder to write.")
    lock_folder(path)
    if is_begun(path):
        resumed = _existing(path, command, settings, overwrite=overwrite)
    if resumed:
        progress.say(f"going on with the unfinished output in {path}")
    remove_leftovers(path)
    record = {
        "command": command,
        "status": "running",
        "settings": settings,
        "files": list(files),
        "provenance": provenance(line or command_line()),
    }
    write_json(path / MARKER, record)
    (path / MOVED).unlink(missing_ok=True)
    return Output(path, record, resumed)


def finished(
    path: Path, command: str, settings: dict[str, Any], *, parts: Sequence[str]
) -> dict[str, Any] | None:
    """What `wildshape.json` says of a finished output of these settings, the folder claimed.

    Args:
        path: the folder.
        command: that made it.
        settings: JSON values, as given to `begin`.
        parts: files that must be there, else the output is not taken for finished.

    Returns:
        None where `begin` has to decide what is there.

    Raises:
        BadInputError: another process is writing there.
    """
    if not (path / MARKER).is_file():
        return None
    lock_folder(path)
    record = _read(path)
    asked = (command, json.loads(json.dumps(settings, default=str)), "finished")
    known = (record.get("command"), record.get("settings"), record.get("status"))
    whole = all((path / part).is_file() for part in parts)
    return record if asked == known and whole else None


def keep_apart(out: Path, *sources: Path | None) -> None:
    """Refuse to read from what is written, which `--overwrite` removes; None is no source.

    Raises:
        BadInputError: an input is the output folder or lies in it.
    """
    target = out.resolve()
    for source in sources:
        if source is not None and target in (source.resolve(), *source.resolve().parents):
            raise BadInputError(f"{out}: holds the input {source}; choose another place to write.")


def is_begun(path: Path) -> bool:
    """Whether a folder holds anything but what a process left that was killed while writing."""
    leftovers = set(path.glob(_LEFTOVER)) if path.is_dir() else set()
    return path.is_dir() and any(entry not in leftovers for entry in path.iterdir())


def is_output(path: Path) -> bool:
    """Whether a folder is itself an output, whole or not; those below it do not make it one."""
    return any((path / name).is_file() for name in MARKERS)


def unlike(record: dict[str, Any], settings: dict[str, Any]) -> str:
    """The names of settings that are not as a record has them, in brackets."""
    known = record.get("settings")
    known = known if isinstance(known, dict) else {}
    names = [name for name in settings if name in known and known[name] != settings[name]]
    return f" (not as it was: {', '.join(names)})" if names else ""


def remove_leftovers(path: Path) -> None:
    """Remove what a process left that was killed while writing; no other may be at work."""
    for leftover in path.rglob(_LEFTOVER):
        if leftover.is_file():
            leftover.unlink(missing_ok=True)


def unfinished(path: Path, command: str) -> bool:
    """Whether an interrupted run of a command left its output here."""
    if not (path / MARKER).is_file():
        return False
    record = _read(path)
    return record.get("command") == command and record.get("status") == "running"


def command_line() -> str:
    """As a user would type it again, of the program that runs: Wildshape's, or what imports it."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    module = spec.name.removesuffix(".__main__") if spec else ""
    ours = "wildshape" in (module.partition(".")[0], Path(*sys.argv[:1]).stem)
    other = ("python", "-m", module) if module else ("python", *filter(None, sys.argv[:1]))
    return shlex.join([*(("wildshape",) if ours else other), *sys.argv[1:]])


def file_name(name: str) -> str:
    """The name itself.

    Raises:
        BadInputError: it is no plain file name, or ours, or leaves no room for a suffix.
    """
    long = len(name.encode(errors="replace")) > _LONGEST_BYTES
    if name[:1] in ("", ".") or name in MARKERS or Path(name).name != name or "\0" in name or long:
        said = f"{name[:_SHOWN]}..." if long else name
        raise BadInputError(f"'{said}': a track or scan of this name cannot become a file; rename.")
    return name


def begin_file(path: Path, *, overwrite: bool) -> None:
    """Refuse to write over a file; what a process left that was killed while writing it goes.

    Raises:
        BadInputError: it exists, and `overwrite` was not given; or it is a folder.
    """
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder; --out names a file to write.")
    if os.path.lexists(path) and not overwrite:  # a link that leads nowhere, too
        raise BadInputError(f"{path}: exists; pass --overwrite to replace it.")
    remove_leftovers_of(path)


def _existing(path: Path, command: str, settings: dict[str, Any], *, overwrite: bool) -> bool:
    """Whether the output there is to be gone on with; with `overwrite` it is set aside."""
    record = _read(path)
    if overwrite:
        set_aside(path, _own_files(path, record))
        return False
    if not (path / MARKER).is_file():
        raise BadInputError(
            f"{path}: holds what is left of an output that was being replaced; pass --overwrite"
            " again, or choose another --out."
        )
    same = record.get("command") == command and record.get("settings") == settings
    if record.get("status") == "finished":
        other = "" if same else " with other settings or of other data"
        raise BadInputError(
            f"{path}: holds the output of an earlier `{record.get('command')}`{other}; pass"
            " --overwrite to replace it, or choose another --out."
        )
    if not same:
        raise BadInputError(
            f"{path}: holds the unfinished output of `{record.get('command')}` with other settings"
            f" or of other data{unlike(record, settings)}; repeat it as it was, pass --overwrite,"
            " or choose another --out."
        )
    return True


def _own_files(path: Path, record: dict[str, Any]) -> list[str]:
    """Patterns of the files that an output says it wrote; none leads out of its folder.

    Raises:
        BadInputError: it does not say.
    """
    with reading(path / MARKER, "which files are an output's"):
        patterns = record.get("files", [])
        found = [file.relative_to(path).parts for one in patterns for file in path.glob(one)]
        if not isinstance(patterns, list) or any(".." in parts for parts in found):
            raise ValueError(f"files {patterns}")
        return patterns


def _read(path: Path) -> dict[str, Any]:
    marker = next((path / name for name in MARKERS if (path / name).is_file()), None)
    if marker is None:
        raise BadInputError(
            f"{path}: is not empty and was not written by this command; choose another --out."
        )
    try:
        record = json.loads(marker.read_text("utf-8"))
    except ValueError as error:
        raise BadInputError(f"{marker}: damaged; choose another --out.") from error
    return record if isinstance(record, dict) else {}


def provenance(command: str) -> dict[str, Any]:
    """JSON values that say how the result of a command line came about.

    torch is asked only if it is imported already: reading a file must not cost seconds.
    """
    return {
        "command": command,
        "wildshape": _version("wildshape"),
        "code": code_version(),
        "python": platform.python_version(),
        "torch": _version("torch"),
        "numpy": _version("numpy"),
        "hardware": _hardware(),
        "time_utc": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def code_version() -> str:
    """The commit of the checkout that this package runs from, or else the package's version.

    Figures that benchmarks write there are no changes of the code.
    """
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return _version("wildshape")
    try:
        commit = _git(root, "rev-parse", "HEAD")
        changed = _git(root, "status", "--porcelain", "-uno", "--", f":!{_RESULTS}")
        return commit + (" with changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return _version("wildshape")


def _git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def _hardware() -> dict[str, Any]:
    data: dict[str, Any] = {"cpu": _cpu_model(), "cores": os.cpu_count(), "gpu": None}
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available():
        data["gpu"] = torch.cuda.get_device_name()
    return data


def _cpu_model() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text("utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
