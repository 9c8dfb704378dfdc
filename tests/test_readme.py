# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The README's promises: its Python and its table of commands run; see also `test_docs.py`."""

import re
import shlex
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildshape.cli.main import COMMANDS, main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_python_of_the_readme_does_what_it_says(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(code, names)
    printed = capsys.readouterr().out
    assert "(8192, 3)" in printed
    translation = names["model"].register(names["scan"], names["moved"]).T_target_source.translation
    assert np.linalg.norm(translation.numpy() - (1, 0, 0)) < 0.3


def test_a_fresh_shell_finds_the_command_and_the_package_as_the_first_screen_says():
    (line,) = [line for line in README.splitlines() if line.startswith(". .venv/bin/activate")]
    assert README.splitlines().index(line) < 20
    assert "pip install ." in line
    made = Path(sys.prefix) / "bin" / "activate"
    if not made.is_file():
        pytest.skip(f"did not run: {sys.prefix} is no virtual environment to activate")
    asked = "command -v wildshape && python -c 'import wildshape'"
    here = line.partition("#")[0].replace(".venv/bin/activate", shlex.quote(str(made)))
    command = ["env", "-i", "PATH=/usr/bin:/bin", "sh", "-c"]
    without = subprocess.run([*command, asked], capture_output=True, text=True)
    assert without.returncode, "the shell was not fresh"
    found = subprocess.run([*command, f"{here}\n{asked}"], capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert Path(found.stdout.strip()).samefile(Path(sys.prefix) / "bin" / "wildshape")


TABLE = re.findall(r"^\| `wildshape ([^`]+)` \|", README, flags=re.MULTILINE)
_FEW_STEPS = ("--steps", "4")  # of training alone; all else runs as it is written


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # viser's
def test_the_command_table_runs_from_top_to_bottom_in_one_folder(tmp_path, monkeypatch):
    from wildshape.report.viewer import page

    def once(served):
        while served.status or served.stage is None:
            time.sleep(0.01)
        raise KeyboardInterrupt

    monkeypatch.setattr(page, "run_until_interrupted", once)
    monkeypatch.setattr("webbrowser.open", lambda _: True)
    monkeypatch.chdir(tmp_path)
    others = {"demo"}
    assert {words.split()[0] for words in TABLE} == set(COMMANDS) - others
    for row in TABLE:
        words = shlex.split(row)
        if words[0] == "export":  # our types, checked under pytest, cannot be traced
            subprocess.run([sys.executable, "-m", "wildshape", *words], check=True)
        else:
            main([*words, *(_FEW_STEPS if words[0] == "train" else ())])
    for made in ("done/report.html", "figures/table.md", "fused.ply", "model.onnx", "info.html"):
        assert (tmp_path / made).is_file(), made


def test_the_readme_says_what_the_method_assumes_and_what_the_weights_learned_from():
    (line,) = [line for line in README.splitlines() if line.startswith("It assumes")]
    needs = (ROOT / "docs/limits.md").read_text("utf-8").partition("## How it fails")[0]
    for assumed in ("time order", "no half turn", "mirror plane", "level"):
        assert assumed in line
        assert assumed in needs
    assert "roofs" in line
    assert "roofs" in needs
    assert "learned from simulated drives alone" in README
