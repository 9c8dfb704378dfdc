# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One process a folder: a second is refused, a dead one is not waited for."""

import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.io.atomic import hold_folder, lock_folder, release_folders, released_after

pytest.importorskip("fcntl", reason="this system has no locks of folders")
HOLDER = (
    "import sys, time; from pathlib import Path;"
    " from wildshape.io.atomic import lock_folder;"
    " lock_folder(Path(sys.argv[1])); print('locked', flush=True); time.sleep(600)"
)


@pytest.fixture(autouse=True)
def _released():
    yield
    release_folders()


@contextmanager
def held(folder):
    """Another process that claims the folder."""
    command = [sys.executable, "-c", HOLDER, str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "locked\n"
        yield process
    finally:
        process.kill()
        process.communicate()


def test_a_second_process_is_refused_until_the_first_has_died(tmp_path):
    folder = tmp_path / "a" / "out"
    with held(folder) as process:
        refused(lock_folder, folder, match="out: another process is writing there; wait")
        process.send_signal(signal.SIGKILL)
        process.wait()
        lock_folder(folder)
    assert not any(folder.iterdir())


def test_one_process_may_claim_again_and_others_after_it_gave_up(tmp_path):
    lock_folder(tmp_path)
    lock_folder(tmp_path)
    release_folders()
    with held(tmp_path), pytest.raises(BadInputError):
        lock_folder(tmp_path)


def test_a_writer_keeps_out_others_of_its_process_and_leaves_an_earlier_claim(tmp_path):
    lock_folder(tmp_path)
    let_go = hold_folder(tmp_path)
    refused(hold_folder, tmp_path, match="another writer of this process")
    let_go()
    with pytest.raises(AssertionError), held(tmp_path):  # refused: the earlier claim holds
        pass
    hold_folder(tmp_path)
    let_go()  # is none of the second writer's
    refused(hold_folder, tmp_path, match="another writer of this process")


def test_after_a_writer_other_processes_may_write(tmp_path):
    hold_folder(tmp_path)()
    with held(tmp_path), pytest.raises(BadInputError, match="another process"):
        hold_folder(tmp_path)
    hold_folder(tmp_path)


def test_claims_end_with_the_outermost_block_and_earlier_ones_stay(tmp_path):
    out, below, before = tmp_path / "out", tmp_path / "out" / "below", tmp_path / "out" / "before"
    lock_folder(before)
    with released_after(out):
        with released_after(out):
            lock_folder(out)
            lock_folder(below)
        with pytest.raises(AssertionError), held(out):  # refused: the outer block is at work
            pass
    with held(out), held(below):
        pass
    with pytest.raises(AssertionError), held(before):
        pass
