# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What scripts read: one JSON object on stdout and nothing else, from every command."""

import json

import numpy as np
import pytest

from wildshape.cli.main import COMMANDS
from wildshape.cli.terminal import answer


def refuse(constant):
    raise AssertionError(f"{constant} is no JSON")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_json(wildshape, command):
    assert "--json " in wildshape(command, "--help").out


def test_commands_say_one_object(wildshape, dataset, store, trained, tmp_path):
    """Those whose output no other test reads whole."""
    model, track = ("--model", trained), dataset / "000001"
    for order in (
        ("fuse", track, "--out", tmp_path / "f.ply", *model),
        ("register", track, "--out", tmp_path / "r", *model),
        ("report", tmp_path / "r"),
        ("info", store, "--out", tmp_path / "info.png"),
        ("evaluate", store, "--out", tmp_path / "e", "--max-scans", 1, "--baselines", "none"),
    ):
        found = wildshape(*order, "--json")
        assert found.code == 0, found
        assert isinstance(json.loads(found.out, parse_constant=refuse), dict), order
        assert found.out.count("\n") == 1


def test_what_is_no_number_is_null(capsys):
    data = {"a": [1.5, float("nan")], "b": {"c": float("inf")}, "d": (np.float64("nan"), "x", 3)}
    answer("", data, as_json=True)
    found = json.loads(capsys.readouterr().out, parse_constant=refuse)
    assert found == {"a": [1.5, None], "b": {"c": None}, "d": [None, "x", 3]}
