# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The fuzzer finds what it is there to find, and in our own readers nothing."""

import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
from tests.fuzz.containers import change_zip, zip_bomb
from tests.fuzz.mutations import LARGEST

RUN = Path(__file__).parent / "run.py"

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is told by Linux's /proc")


def fuzz(out, *options):
    command = [sys.executable, str(RUN), "--out", str(out), *map(str, options)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def row(done, name):
    """What the table says of a reader: inputs, read, refused, and its failures."""
    (*_, line) = (line for line in done.stdout.splitlines() if line.startswith(f"{name} "))
    words = line.split()
    return [int(word) for word in words[1:4]], " ".join(words[7:])


@pytest.mark.parametrize(
    ("reader", "failure"),
    [
        ("raises", "foreign ValueError"),
        ("crashes", "crash"),
        ("hangs", "hang"),
        ("eats", "memory"),
        ("asks", "memory"),
        ("prints", "printed"),
        ("warns", "printed"),
        ("infinite", "not finite"),
        ("mute", "message"),
    ],
)
def test_a_reader_that_breaks_a_rule_is_found(reader, failure, tmp_path):
    count = 1 if reader == "hangs" else 8
    broken = ("--targets", "tests.fuzz.broken", "--only", reader, "--inputs", 0, "--each", count)
    done = fuzz(tmp_path, *broken)
    assert done.returncode == 1, done.stdout + done.stderr
    assert row(done, reader)[0][0] == count
    assert row(done, reader)[1].endswith(failure)
    (kept, *_) = tmp_path.glob(f"{reader}/valid/*/scan.bin")
    assert kept.read_bytes() != b"16 valid bytes.."


def test_a_reader_that_refuses_passes_and_a_seed_is_the_same_inputs(tmp_path):
    broken = ("--targets", "tests.fuzz.broken", "--only", "right", "--inputs", 0, "--each", 200)
    done, again = (fuzz(tmp_path, *broken, "--workers", workers) for workers in (1, 2))
    assert (done.returncode, again.returncode) == (0, 0)
    counts, failures = row(done, "right")
    assert counts[0] == 200
    assert counts[2] > 150
    assert failures == ""
    assert row(again, "right")[0] == counts


def test_a_run_goes_on_from_its_state(tmp_path):
    state, counts = tmp_path / "state.json", ("--inputs", 0, "--each", 8)
    broken = ("--targets", "tests.fuzz.broken", "--only", "mute", *counts, "--state", state)
    first, second = fuzz(tmp_path, *broken), fuzz(tmp_path, *broken)
    assert (first.returncode, second.returncode) == (1, 1)
    assert row(first, "mute") == row(second, "mute")
    assert "mute 0: message" in first.stdout
    assert "mute 0: message" not in second.stdout  # nothing was left to be done


def test_a_bomb_is_damaged_as_it_is():  # unpacked and packed again it would take seconds
    assert all(len(change_zip(Random(seed), zip_bomb())) < LARGEST for seed in range(20))


def test_our_readers_break_no_rule(tmp_path):
    done = fuzz(tmp_path, "--inputs", 0, "--each", 200)
    assert done.returncode == 0, done.stdout + done.stderr
