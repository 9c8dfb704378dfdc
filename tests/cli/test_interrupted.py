# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Processes that are killed: finished work stays, and the same command goes on."""

import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import torch
from safetensors.torch import load_file

from wildshape.io.points import read_points
from wildshape.io.tracks import read_poses

_COPIES = 60

# A shell that starts the tests in the background has them ignore Ctrl-C, and all that they start.
PROGRAM = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    " import torch; torch.set_num_threads(1); from wildshape.cli.main import main; main()"
)


@contextmanager
def running(*arguments):
    command = [sys.executable, "-c", PROGRAM, *(str(argument) for argument in arguments)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def wait_for(condition, process):
    until = time.monotonic() + 300
    while not condition():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < until
        time.sleep(0.002)


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
    assert f"{len(finished)} tracks had been finished before" in found.out
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
