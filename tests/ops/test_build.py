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


@pytest.mark.parametrize("asked", [" ", "'cc"])
def test_what_names_no_compiler_is_quoted(hook, sources, monkeypatch, asked):
    monkeypatch.setenv("CC", asked)
    assert hook.compile_library(sources) == f"CC={asked!r} names no compiler"


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler")
def test_a_failing_compiler_is_quoted(hook, sources, monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    (sources / "broken.c").write_text("not C\n")
    assert "broken.c" in hook.compile_library(sources)


@pytest.mark.parametrize(
    ("system", "asked", "why"), [("win32", "", "Windows"), ("linux", "0", "=0")]
)
def test_kernels_are_left_out_on_windows_and_on_request(hook, monkeypatch, system, asked, why):
    monkeypatch.setenv("WILDSHAPE_NATIVE", asked)
    monkeypatch.setattr(hook.sys, "platform", system)
    assert why in hook.unwanted()


def test_kernels_are_wanted_elsewhere(hook, monkeypatch):
    monkeypatch.delenv("WILDSHAPE_NATIVE", raising=False)
    for system in ("linux", "darwin"):
        monkeypatch.setattr(hook.sys, "platform", system)
        assert hook.unwanted() == ""


def test_a_wheel_for_macos_is_for_the_oldest_it_is_compiled_for(hook, monkeypatch):
    monkeypatch.setattr(hook.sys, "platform", "darwin")
    monkeypatch.setattr(hook.platform, "machine", lambda: "arm64")
    for oldest, tag in (("11.0", "macosx_11_0_arm64"), ("14", "macosx_14_0_arm64")):
        monkeypatch.setenv("MACOSX_DEPLOYMENT_TARGET", oldest)
        assert hook.platform_tag() == tag
