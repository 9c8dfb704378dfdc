# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Whatever reads a packed store says which of its files is damaged, and makes nothing of it."""

import json
import shutil

import pytest

STEPS = ("--preset", "tiny", "--steps", "50", "--device", "cpu")


def damage(store, path, name):
    """A copy of a store of which one file has flipped bits, spread over all of it."""
    shutil.copytree(store, path)
    bad = bytearray((path / name).read_bytes())
    for place in range(400, len(bad), 500):
        bad[place] ^= 16
    (path / name).write_bytes(bad)
    return path


COMMANDS = {
    "train": lambda store, out: ("train", store, "--out", out, *STEPS),
    "train dpc": lambda store, out: ("train", store, "--out", out, "--preset", "dpc-lidar"),
    "complete": lambda store, out: ("complete", store, "--out", out),
    "evaluate": lambda store, out: ("evaluate", store, "--out", out, "--baselines", "identity"),
    "info": lambda store, _: ("info", store),
    "folders": lambda store, out: ("convert", "packed", store, out, "--layout", "folders"),
    "packed again": lambda store, out: ("convert", "packed", store, out),
}


@pytest.mark.parametrize("name", ["points-00000.safetensors", "index.safetensors", "index.json"])
@pytest.mark.parametrize("command", COMMANDS)
def test_the_damaged_file_is_named(refused, store, tmp_path, command, name):
    path, out = damage(store, tmp_path / "damaged.store", name), tmp_path / "out"
    said = refused(*COMMANDS[command](path, out))
    assert str(path / name) in said
    kept = [f.name for f in out.rglob("*") if f.suffix in (".ply", ".safetensors", ".md")]
    assert kept == []


def test_what_is_whole_is_still_completed(wildshape, store, trained, tmp_path):
    path = shutil.copytree(store, tmp_path / "damaged.store")
    shard = path / "points-00000.safetensors"
    bad = bytearray(shard.read_bytes())
    bad[256 + 30] ^= 1  # of the first scan
    shard.write_bytes(bad)
    found = wildshape("complete", path, "--out", tmp_path / "c", "--model", trained, "--json")
    assert found.code == 0
    said = json.loads(found.out)
    assert (said["tracks"], [entry["what"] for entry in said["skipped"]]) == (5, ["000000"])
    assert str(shard) in said["skipped"][0]["reason"]
