# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The build hook: a library where a compiler is, one reason and no error where none is."""

import ctypes
import importlib.util
import shutil
from pathlib import Path

import pytest

from wildshape.ops import library

ROOT = Path(__file__).parents[2]


@pytest.fixture
def hook():
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def sources(hook, tmp_path):
    return shutil.copytree(
        ROOT / hook.NATIVE, tmp_path / "native", ignore=shutil.ignore_patterns("*.so")
    )


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
def test_compiles_one_library_and_leaves_nothing_else(hook, sources, monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    before = {path.name for path in sources.iterdir()}
    assert hook.compile_library(sources) == ""
    assert {path.name for path in sources.iterdir()} == before | {hook.LIBRARY}
    assert ctypes.CDLL(str(sources / hook.LIBRARY)).wildshape_abi() == library._ABI


def test_without_a_compiler_it_says_so_and_goes_on(hook, sources, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    assert hook.compile_library(sources) == "no C compiler `no-such-compiler`"


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
def test_a_failing_compiler_is_quoted(hook, sources, monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    (sources / "broken.c").write_text("not C\n")
    assert "broken.c" in hook.compile_library(sources)
