# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Who works on what does not show in what is written."""

import json

import pytest
import torch


def written(out):
    """All files, without times and places."""
    found = {}
    for file in sorted(path for path in out.rglob("*") if path.is_file()):
        if file.suffix != ".json":
            found[file.relative_to(out)] = file.read_bytes()
        elif file.name == "objects.json":
            said = {**json.loads(file.read_text()), "input": None}
            scans = [{**scan, "seconds": None} for scan in said["scans"]]
            found[file.relative_to(out)] = {**said, "scans": scans}
        elif file.name == "scores.json":
            found[file.relative_to(out)] = json.loads(file.read_text())
    return found


@pytest.mark.parametrize(
    ("command", "options", "files"),
    [("complete", (), 6 * (6 + 2)), ("evaluate", ("--rotate", "yaw", "--max-scans", 2), 4)],
)
def test_the_same_is_written_by_any_number_of_workers(
    wildshape, dataset, trained, tmp_path, request, command, options, files
):
    given = command, dataset, "--model", trained, "--json", *options
    alone = wildshape(*given, "--out", tmp_path / "alone", "--workers", 1)
    assert json.loads(alone.out)["workers"] == 1
    request.getfixturevalue("only_helpers")
    spread = wildshape(*given, "--out", tmp_path / "spread", "--workers", 2)
    assert json.loads(spread.out)["workers"] == 2
    assert written(tmp_path / "spread") == written(tmp_path / "alone")
    assert len(written(tmp_path / "alone")) >= files


@pytest.mark.parametrize("options", [(), ("--track",)])
def test_the_same_is_written_on_any_number_of_torchs_threads(wildshape, dataset, tmp_path, options):
    """Sums of torch depend on it, and the nearest neighbours of what was summed."""
    before = torch.get_num_threads()
    try:
        for count in (1, 2, 3):
            torch.set_num_threads(count)
            out = tmp_path / str(count)
            assert wildshape("complete", dataset, "--out", out, "--workers", 1, *options).code == 0
            assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(before)
    one, two, three = (written(tmp_path / str(count)) for count in (1, 2, 3))
    assert one == two == three
