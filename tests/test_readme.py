# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The README's promises: its Python runs, its commands exist, its links lead somewhere."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wildshape.cli.main import main

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


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`wildshape ([a-z]+)", README))))
def test_every_command_of_the_readme_has_help_with_an_example(command, capsys):
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code in (0, None)
    assert f"wildshape {command}" in capsys.readouterr().out


def test_links_lead_to_files_of_the_project():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert target.startswith("https://") or (ROOT / target).is_file(), target
