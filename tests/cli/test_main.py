# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import shlex
import subprocess
import sys
from importlib import import_module

import pytest
import tyro

from wildshape.cli.main import COMMANDS


def python(program):
    return subprocess.run(
        [sys.executable, "-X", "importtime", "-c", program],
        capture_output=True,
        text=True,
        check=True,
    )


def test_help_lists_every_command_and_imports_nothing_heavy(wildshape):
    found = python("from wildshape.cli.main import main; main(['--help'])")
    for command in COMMANDS:
        assert f"\n  {command} " in found.stdout
    imported = {line.rsplit("|", 1)[-1].strip() for line in found.stderr.splitlines()}
    assert not imported & {"torch", "numpy", "tyro", "rich", "jaxtyping"}
    assert wildshape().out == found.stdout


def test_help_is_quick():
    found = python("from wildshape.cli.main import main; main(['--help'])")
    lines = [line for line in found.stderr.splitlines() if line.endswith(" wildshape.cli.main")]
    microseconds = int(lines[0].split("|")[1])
    assert microseconds < 200_000, lines


def test_help_of_no_command_imports_torch():
    names = ", ".join(f"'{name}'" for name in COMMANDS)
    python(
        "import sys\n"
        "from wildshape.cli.main import main\n"
        f"for name in ({names}):\n"
        "    try: main([name, '--help'])\n"
        "    except SystemExit as leaving: assert leaving.code == 0, name\n"
        "    assert not {'torch', 'numpy'} & set(sys.modules), name\n"
    )


@pytest.mark.parametrize("command", COMMANDS)
def test_help_ends_with_an_example_that_can_be_typed(wildshape, command):
    found = wildshape(command, "--help")
    assert found.code == 0
    heading, example = found.out.rstrip().splitlines()[-2:]
    assert heading == "example:"
    words = shlex.split(example)
    assert words[:2] == ["wildshape", command]
    settings = tyro.cli(import_module(f"wildshape.cli.{command}").Settings, args=words[2:])
    assert settings is not None


def test_unknown_command_and_usage(wildshape, refused):
    assert "'compleet' is no command" in refused("compleet")
    found = wildshape("complete")
    assert (found.code, found.out) == (2, "")
    found = wildshape("train", "x", "--out", "y", "--sped", "3")
    assert (found.code, found.out) == (2, "")


def test_version(wildshape):
    assert wildshape("--version").out.strip().count(".") == 2
