# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Baselines by name, and what is said where a library is missing."""

import sys
from importlib.abc import MetaPathFinder

import pytest

from wildshape.baselines.compare import load_models
from wildshape.baselines.named import NAMES, baseline
from wildshape.errors import BadInputError, MissingExtraError


class Broken(MetaPathFinder):
    """An installed library whose own library of the system is missing."""

    def __init__(self, name):
        self.name = name

    def find_spec(self, fullname, path=None, target=None):
        if fullname == self.name:
            raise ImportError("libusb-1.0.so.0: cannot open shared object file")


@pytest.fixture
def without(monkeypatch):
    """Make modules impossible to import."""

    def hide(*names):
        for name in names:
            monkeypatch.setitem(sys.modules, name, None)

    return hide


def test_an_unknown_name_is_refused_with_those_there_are():
    with pytest.raises(BadInputError, match=r"'icp' is no baseline; there are identity, .*gicp"):
        baseline("icp")


def test_every_baseline_says_what_it_is():
    for name in ("identity", "one-scan", "local-icp", "multi-start-icp", "gicp"):
        assert baseline(name).about
    assert "0.175 m" in baseline("local-icp").about


def test_global_icp_names_both_engines_where_neither_is(without):
    without("open3d", "kiss_matcher")
    with pytest.raises(MissingExtraError) as refused:
        baseline("global-icp")
    assert "wildshape[open3d]" in str(refused.value)
    assert "kiss-matcher" in str(refused.value)
    with pytest.raises(MissingExtraError, match="pip install kiss-matcher"):
        baseline("kiss-matcher")


def test_global_icp_falls_back_and_says_so(without):
    pytest.importorskip("kiss_matcher", reason="kiss-matcher has no wheel for this Python")
    without("open3d")
    method = baseline("global-icp")
    assert "KISS-Matcher" in method.about
    assert "voxel 0.125 m" in method.about


def test_a_missing_library_of_the_system_is_named(without, monkeypatch):
    without("kiss_matcher")
    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Broken("open3d"), *sys.meta_path])
    with pytest.raises(MissingExtraError, match=r"does not load \(libusb.*apt install") as refused:
        baseline("global-icp")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_cannot_take_the_row_of_a_baseline(name, tmp_path):
    file, run = tmp_path / f"{name}.safetensors", tmp_path / name
    run.mkdir()
    for model in (file, run / "model.safetensors"):
        model.write_bytes(b"")
        with pytest.raises(BadInputError, match=f"{name} is the name of a baseline"):
            load_models([model], "cpu")
