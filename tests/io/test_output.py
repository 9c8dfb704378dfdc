# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import shutil
import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from tests.refusal import refused
from tests.stopping import stopped_at

from wildshape.errors import BadInputError, LostWorkersError
from wildshape.io import output
from wildshape.io.atomic import atomic_write
from wildshape.io.earlier import EARLIER
from wildshape.io.output import (
    MARKER,
    Output,
    begin,
    begin_file,
    command_line,
    finished,
    provenance,
)


def test_says_what_is_needed_to_do_it_again() -> None:
    data = provenance("wildshape simulate out")
    assert data["command"] == "wildshape simulate out"
    assert data["hardware"]["cores"] >= 1
    assert data["time_utc"].endswith("+00:00")
    assert {"wildshape", "code", "python", "torch", "numpy"} <= data.keys()
    assert json.loads(json.dumps(data)) == data


@pytest.mark.parametrize(
    ("module", "program", "said"),
    [
        (None, "/usr/bin/wildshape", "wildshape OUT --seed 1"),
        ("wildshape.cli.__main__", "/x/__main__.py", "wildshape OUT --seed 1"),
        ("experiments.tables.__main__", "/x/a.py", "python -m experiments.tables OUT --seed 1"),
        (None, "examples/a.py", "python examples/a.py OUT --seed 1"),
        (None, "", "python OUT --seed 1"),  # typed into Python itself
    ],
)
def test_what_another_program_made_is_not_said_to_be_a_command_of_ours(
    module: str | None, program: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec = module and ModuleSpec(module, None)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", spec)
    monkeypatch.setattr(sys, "argv", [program, "OUT", "--seed", "1"])
    assert command_line() == said


@pytest.mark.skipif(shutil.which("git") is None, reason="no git")
def test_changed_code_is_said_and_figures_that_benchmarks_write_are_no_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, figures = tmp_path / "src/package/io/output.py", tmp_path / "benchmarks/results/a.csv"
    for file in (code, figures):
        file.parent.mkdir(parents=True)
        file.write_text("1")
    git = ("git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b.c")
    for does in (("init", "-q"), ("add", "."), ("commit", "-qm", "first")):
        subprocess.run([*git, *does], check=True)
    monkeypatch.setattr(output, "__file__", str(code))
    commit = provenance("x")["code"]
    assert len(commit) == 40
    figures.write_text("2")
    assert provenance("x")["code"] == commit
    code.write_text("2")
    assert provenance("x")["code"] == f"{commit} with changes"


def test_does_not_import_torch() -> None:
    code = "import sys; from wildshape.io.output import provenance; provenance('x')"
    code += "; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def _written(out: Path, setting: int, *, overwrite: bool = False) -> Output:
    """An output of two files, not finished yet, among a file of somebody else's."""
    output = begin(out, "complete", {"a": setting}, ["**/*.ply"], overwrite=overwrite)
    (out / "deep").mkdir(exist_ok=True)
    for name in ("0.ply", "deep/1.ply", "notes.txt"):
        (out / name).write_text(f"{setting}")
    return output


def _content(out: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}


@pytest.mark.parametrize("moved", range(3))
def test_a_replacement_that_was_stopped_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moved: int
) -> None:
    """What was left was of no command's making, and `--overwrite` was refused for good."""
    out = tmp_path / "out"
    _written(out, 1).finish()
    with stopped_at(shutil, "move", moved, monkeypatch):
        begin(out, "complete", {"a": 2}, ["**/*.ply"], overwrite=True)
    assert not (out / MARKER).exists()
    for settings in ({"a": 1}, {"a": 2}):
        assert finished(out, "complete", settings, parts=()) is None
        refused(begin, out, "complete", settings, ["*.ply"], match="pass --overwrite again")
    again = begin(out, "complete", {"a": 2}, ["**/*.ply"], overwrite=True)
    assert not again.resumed
    assert sorted(file.name for file in out.iterdir()) == [EARLIER, "notes.txt", MARKER]
    again.abandon()
    assert finished(out, "complete", {"a": 1}, parts=("0.ply", "deep/1.ply")) is not None
    assert not (out / EARLIER).exists()


def test_what_is_replaced_is_kept_until_the_new_is_finished(tmp_path: Path) -> None:
    out = tmp_path / "out"
    _written(out, 1).finish()
    (out / "notes.txt").write_text("mine")
    before = _content(out)
    begin(out, "complete", {"a": 2}, ["*.ply"], overwrite=True)
    (out / "2.ply").write_text("of a command that was killed")
    output = begin(out, "complete", {"a": 2}, ["*.ply"], overwrite=True)
    (out / "2.ply").write_text("half")
    with pytest.raises(BadInputError), output.abandoned_if_refused():
        raise BadInputError("a wrong unit")
    assert _content(out) == before
    output = _written(out, 3, overwrite=True)
    with pytest.raises(LostWorkersError), output.abandoned_if_refused():
        raise LostWorkersError("no memory")
    assert begin(out, "complete", {"a": 3}, ["**/*.ply"]).resumed
    output.finish()
    assert not (out / EARLIER).exists()
    assert {path.read_text() for path in out.rglob("*.ply")} == {"3"}


@pytest.mark.parametrize("files", [None, -1, "*.ply", [None], ["/*"], ["../*"], ["*/../../*"]])
def test_nothing_is_removed_by_patterns_that_are_none_or_lead_out(
    tmp_path: Path, files: object
) -> None:
    """`../*` moved the files beside the folder into it, and the last of them were lost."""
    out = tmp_path / "out"
    _written(out, 1).finish()
    (tmp_path / "mine.txt").write_text("mine")
    marker = out / MARKER
    marker.write_text(json.dumps({**json.loads(marker.read_text()), "files": files}))
    before = _content(tmp_path)
    settings = "complete", {"a": 2}, ["*.ply"]
    refused(begin, out, *settings, overwrite=True, match=f"{MARKER}: expected which files are")
    assert _content(tmp_path) == before


_KILLED_WRITING = """
import os, signal, sys
from wildshape.io.atomic import atomic_write
with atomic_write(sys.argv[1]) as file:
    file.write(b"half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("name", ["fused.ply", "[a]*.ply", "n" * 255])
def test_what_a_killed_process_left_of_a_file_goes_with_the_next(name: str, tmp_path: Path) -> None:
    """Neither what is being written now, nor what others left, nor what belongs to others."""
    file, others = tmp_path / name, [tmp_path / ".film.part", tmp_path / ".b.ply.x1y2.part"]
    for other in others:
        other.write_text("theirs")
    subprocess.run([sys.executable, "-c", _KILLED_WRITING, str(file)], check=False)
    assert len(list(tmp_path.iterdir())) == 3
    with atomic_write(file) as written:
        written.write(b"whole")
        begin_file(file, overwrite=False)
        assert len(list(tmp_path.iterdir())) == 3
    assert sorted(tmp_path.iterdir()) == sorted([*others, file])
    assert file.read_bytes() == b"whole"
