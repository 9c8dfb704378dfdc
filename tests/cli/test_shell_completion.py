# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The shells complete what the commands take."""

import shutil
import subprocess

import pytest

from wildshape.cli.commands import module_of
from wildshape.cli.main import COMMANDS
from wildshape.cli.shell_completion import SHELLS, options_of

_ASK = """
source "$1"; shift
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1))
_wildshape
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def complete(wildshape, tmp_path):
    """What bash offers for the last word."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("did not run: no bash on PATH to complete in")
    file = tmp_path / "completion.bash"
    file.write_text(wildshape("--print-completion", "bash").out)

    def ask(*words):
        command = [bash, "-c", _ASK, "bash", str(file), "wildshape", *words]
        found = subprocess.run(command, capture_output=True, text=True, check=True)
        assert found.stderr == ""
        return found.stdout.split()

    return ask


def test_bash_completes_commands_options_and_words(complete):
    assert complete("comp") == ["complete"]
    assert set(complete("")) > set(COMMANDS)
    assert complete("complete", "scan.ply", "--mesh-f") == ["--mesh-format"]
    assert complete("complete", "scan.ply", "--mesh-format", "") == ["ply", "obj", "glb"]
    assert complete("register", "--tr") == ["--track"], "not the field's name, but the option's"
    assert complete("complete", "scan") == [], "file names are left to the shell"
    assert complete("--print-completion", "") == list(SHELLS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_offered_is_taken(command, wildshape):
    help_text = wildshape(command, "--help").out
    for option, words in options_of(module_of(command).Settings).items():
        assert option in help_text
        assert all(word in help_text for word in words)


def test_zsh_has_bash_completion_loaded_first(wildshape):
    bash, zsh = (wildshape("--print-completion", shell).out for shell in SHELLS)
    assert zsh.endswith(bash)
    assert "bashcompinit" in zsh


def test_another_shell_is_refused(refused):
    assert "bash or zsh" in refused("--print-completion", "csh")
    assert "bash or zsh" in refused("--print-completion")
