# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Collecting garbage is put off, and taken up again whatever happens."""

import gc
import sys

import pytest

from wildshape.cli.commands import uncollected


def test_collection_is_off_inside_and_on_afterwards():
    assert gc.isenabled()
    with uncollected():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ImportError), uncollected():
        raise ImportError
    assert gc.isenabled()


def test_what_a_cold_start_imports_is_never_walked_again(monkeypatch):
    with uncollected():
        pass
    assert gc.get_freeze_count() == 0
    with monkeypatch.context() as patched:
        patched.delitem(sys.modules, "torch")
        with uncollected():
            pass
    assert gc.get_freeze_count() > 0
    gc.unfreeze()
