# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that are killed: finished work stays, and the same command goes on."""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from tests.cli.processes import running, wait_for

from wildshape import __version__
from wildshape.io.scans.points import read_points
from wildshape.io.store.layout import JOINING_JSON
from wildshape.io.store.store import Store
from wildshape.io.tracks import read_poses

_COPIES = 60
_STOPPED_IMPORT = """
import runpy, signal, sys

class Finder:
    def find_spec(name, *_):
        if name == "wildshape.cli.terminal":
            signal.raise_signal(signal.SIGINT)

signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Finder)
runpy.run_module(sys.argv[1], run_name="__main__")
"""
_STOPPED_EXIT = """
import atexit, runpy, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)
atexit.register(signal.raise_signal, signal.SIGINT)
sys.argv = ["wildshape", "--version"]
runpy.run_module("wildshape", run_name="__main__")
"""


def test_a_killed_complete_goes_on(wildshape, dataset, trained, tmp_path):
    out = tmp_path / "c"
    command = ("complete", dataset, "--out", out, "--model", trained)
    with running(*command) as process:
        wait_for(lambda: any(out.glob("*/objects.json")), process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    finished = {path: path.stat().st_mtime_ns for path in out.glob("*/objects.json")}
    assert 0 < len(finished) < 6
    kept = {
        file: file.stat().st_mtime_ns
        for path in finished
        for file in path.parent.rglob("*")
        if file.is_file()
    }
    found = wildshape(*command)
    assert found.code == 0
    plural = "s" if len(finished) > 1 else ""
    assert f"{len(finished)} track{plural} had been finished before" in found.out
    assert all(file.stat().st_mtime_ns == when for file, when in kept.items())
    assert len(list(out.glob("*/objects.json"))) == 6
    for folder in out.glob("0*"):
        clouds = [read_points(file) for file in (folder / "completed").glob("*.ply")]
        assert len(clouds) == len(read_poses(folder / "poses.txt")) == 6
    assert not list(out.rglob(".*"))


def test_a_terminated_training_resumes_to_the_same_weights(wildshape, short_run, trained, tmp_path):
    arguments = short_run(tmp_path / "run")
    log = tmp_path / "run" / "log.jsonl"
    with running(*arguments) as process:
        wait_for(lambda: log.exists() and log.stat().st_size > 0, process)
        process.terminate()
        _, said = process.communicate(timeout=60)
    assert process.returncode == 143, said
    assert "--resume" in said.splitlines()[-1]
    assert not (tmp_path / "run" / "model.safetensors").exists()
    assert wildshape(*arguments, "--resume").code == 0
    resumed = load_file(tmp_path / "run" / "model.safetensors")
    undisturbed = load_file(trained / "model.safetensors")
    assert all(torch.equal(resumed[name], undisturbed[name]) for name in undisturbed)


def test_ctrl_c_ends_with_one_sentence(dataset, trained, tmp_path):
    out, many = tmp_path / "c", tmp_path / "many"
    for copy in range(_COPIES):  # more than is completed before the signal comes
        for track in sorted(dataset.iterdir()):
            if (track / "scans").is_dir():
                shutil.copytree(track, many / f"{copy:02d}-{track.name}")
    with running("complete", many, "--out", out, "--model", trained) as process:
        wait_for(lambda: any(out.glob("*/objects.json")), process)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    assert "stopped" in said
    assert "Traceback" not in said


def test_a_half_written_store_is_begun_again(wildshape, refused, tmp_path):
    out = tmp_path / "s.store"
    arguments = ("simulate", out, "--tracks", 80, "--scans", 6, "--workers", 1)
    with running(*arguments) as process:
        wait_for(lambda: any(out.glob("points-*")), process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert "half-written" in refused("complete", out, "--out", tmp_path / "c")
    assert "half-written" in refused("simulate", out, "--tracks", 2)
    found = wildshape(*arguments)
    assert found.code == 0
    assert "again" in found.err


def test_two_writers_of_one_output_do_not_mix(wildshape, dataset, trained, tmp_path):
    """The second is refused while the first works; before, it removed the first one's files."""
    out = tmp_path / "c"
    command = ("complete", dataset, "--out", out, "--model", trained)
    with running(*command) as process:
        wait_for(lambda: any(out.glob("*/completed/*.ply")), process)
        process.send_signal(signal.SIGSTOP)
        second = wildshape(*command)
        process.send_signal(signal.SIGCONT)
        assert process.wait(60) == 0
    assert second.code == 2
    assert "another process is writing there" in second.err
    assert len(list(out.glob("*/objects.json"))) == 6


@pytest.mark.parametrize("command", ["complete", "train"])
def test_killed_while_the_marker_was_written(
    wildshape, dataset, trained, short_run, tmp_path, command
):
    """Nothing but a `.part` file was there: that is no foreign folder, and it is removed."""
    out = tmp_path / "out"
    out.mkdir()
    (out / ".wildshape.json.x1y2.part").write_text("{")
    lines = {
        "complete": ("complete", dataset, "--out", out, "--model", trained),
        "train": (*short_run(out, steps=2), "--resume"),
    }
    assert wildshape(*lines[command]).code == 0
    assert not list(out.glob(".*"))


def test_a_killed_training_leaves_no_half_written_files(wildshape, short_run, trained, tmp_path):
    out = tmp_path / "run"
    with running(*short_run(out)) as process:
        wait_for(lambda: (out / "run.json").exists(), process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    json.loads((out / "run.json").read_text())
    (out / ".state.safetensors.x1y2.part").write_bytes(b"half")
    assert wildshape(*short_run(out), "--resume").code == 0
    assert not list(out.glob(".*"))
    resumed, whole = (load_file(f / "model.safetensors") for f in (out, trained))
    assert all(torch.equal(resumed[name], whole[name]) for name in whole)


@pytest.mark.parametrize("stopped_at", [1, 2])
def test_a_conversion_to_folders_killed_at_its_end(
    wildshape, dataset, tmp_path, monkeypatch, stopped_at
):
    """While the parts are removed: their tracks had moved, and were made and moved again."""
    remove, out, calls = shutil.rmtree, tmp_path / "out", []

    def removed_in_part(path, **options):
        calls.append(path)
        if path.name == ".parts" and len(calls) >= stopped_at:
            for result in path.glob("*/part.json"):
                result.unlink()
            raise KeyboardInterrupt
        remove(path, **options)

    command = ("convert", "folder", dataset, out, "--layout", "folders", "--workers", 1)
    with monkeypatch.context() as patched:
        patched.setattr("wildshape.datasets.destinations.shutil.rmtree", removed_in_part)
        assert wildshape(*command).code == 130
    again = wildshape(*command)
    assert again.code == 0 or "--overwrite" in again.err
    assert not list(out.glob(".*"))
    assert json.loads((out / "wildshape.json").read_text())["status"] == "finished"
    assert len(list(out.glob("*/scans/*.ply"))) == len(list(dataset.glob("*/scans/*.ply")))


def test_a_packed_conversion_killed_at_its_very_end(wildshape, dataset, tmp_path, monkeypatch):
    """The store was whole; only the plan of its join was still there."""
    out, remove = tmp_path / "out", Path.unlink
    command = ("convert", "folder", dataset, out, "--workers", 1)

    def killed(path, *, missing_ok=False):
        if path.name == JOINING_JSON and path.is_file():
            raise KeyboardInterrupt
        remove(path, missing_ok=missing_ok)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", killed)
        assert wildshape(*command).code == 130
    assert (out / JOINING_JSON).is_file()
    again = wildshape(*command)
    assert again.code == 2
    assert "--overwrite" in again.err
    assert not (out / JOINING_JSON).exists()
    assert len(Store(out)) == len(list(dataset.glob("*/scans")))


def test_a_store_killed_while_its_first_file_was_written(wildshape, tmp_path):
    out = tmp_path / "s.store"
    out.mkdir()
    (out / ".writing.json.x1y2.part").write_text("{")
    assert wildshape("simulate", out, "--tracks", 2, "--scans", 2, "--workers", 1).code == 0
    assert not list(out.glob(".*"))


@pytest.mark.parametrize("module", ["wildshape", "wildshape.cli"])
def test_ctrl_c_amid_the_first_imports_leaves_no_traceback(module):
    command = [sys.executable, "-c", _STOPPED_IMPORT, module]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == 130
    assert not found.stderr


def test_ctrl_c_on_the_way_out_leaves_no_traceback():
    """The work is done, and said; Python's own end is what the signal meets."""
    command = [sys.executable, "-c", _STOPPED_EXIT]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == -signal.SIGINT
    assert found.stdout.strip() == __version__
    assert not found.stderr
