# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What scripts read: one JSON object on stdout and nothing else, from every command."""

import io
import json
import signal
import sys
import time
from importlib import import_module

import numpy as np
import pytest

from wildshape.cli.main import COMMANDS
from wildshape.cli.terminal import Terminated, answer, terminable
from wildshape.errors import BadInputError


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


@pytest.mark.parametrize(("code", "shown"), [("ascii", "\\u8eca \\xe9"), ("cp1252", "\\u8eca é")])
def test_a_terminal_that_does_not_know_a_letter_is_shown_its_number(code, shown, monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, code))
    answer("see 車 é", {}, as_json=False)
    assert written.getvalue().decode(code).strip() == f"see {shown}"


def blame(number, error):
    """What a library does that a signal met in its native code."""
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt:
        raise error from None


@pytest.mark.parametrize(
    ("number", "stopped"), [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)]
)
@pytest.mark.parametrize("error", [BadInputError("model: not readable."), BaseException("a panic")])
def test_what_a_library_makes_of_a_signal_leaves_as_the_signal(number, stopped, error):
    with pytest.raises(stopped) as left, terminable():
        blame(number, error)
    assert left.type is stopped


def test_a_signal_waits_for_the_end_of_an_import(tmp_path, monkeypatch):
    """In torch's it ended in an abort, or was dropped, and the command went on."""
    lines = "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n"

    def work():
        import_module("stopped_import")
        time.sleep(60)

    (tmp_path / "stopped_import.py").write_text(lines)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), terminable():
        work()
    assert sys.modules.pop("stopped_import").whole
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0


def test_without_a_signal_an_error_stays_as_it_is():
    with pytest.raises(BadInputError, match="not readable"), terminable():
        raise BadInputError("model: not readable.")
