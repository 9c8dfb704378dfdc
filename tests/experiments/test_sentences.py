# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Experiments end as commands do: with one sentence where the input is bad, never a traceback."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(path for path in (ROOT / "experiments").glob("*.py") if path.stem != "__init__")


@pytest.mark.parametrize("command", [("curve_picture.py", "x.svg"), ("mesh_credits.py",)])
def test_a_missing_file_is_one_sentence(tmp_path, command):
    script, *rest = command
    arguments = ["-m", f"experiments.{script[:-3]}", str(tmp_path / "none"), *rest]
    done = subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 2
    assert done.stderr.startswith(f"wildshape: {tmp_path / 'none'}")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_every_script_finds_what_it_imports_and_ends_so(script):
    importlib.import_module(f"experiments.{script.stem}")
    text = script.read_text("utf-8")
    if '__name__ == "__main__"' not in text:
        return
    last = text.split('__name__ == "__main__"')[1]
    assert "in_a_sentence()" in last or "begin(" in last
