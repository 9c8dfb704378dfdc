# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import subprocess
import sys
from pathlib import Path

import pytest
from tests.refusal import refused
from tests.stopping import stopped_at_removal

from wildshape.io.output import MARKER, begin, finished, provenance


def test_says_what_is_needed_to_do_it_again() -> None:
    data = provenance("wildshape simulate out")
    assert data["command"] == "wildshape simulate out"
    assert data["hardware"]["cores"] >= 1
    assert data["time_utc"].endswith("+00:00")
    assert {"wildshape", "code", "python", "torch", "numpy"} <= data.keys()
    assert json.loads(json.dumps(data)) == data


def test_does_not_import_torch() -> None:
    code = "import sys; from wildshape.io.output import provenance; provenance('x')"
    code += "; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.parametrize("removed", range(3))
def test_a_removal_that_was_stopped_is_repeated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, removed: int
) -> None:
    """What was left was of no command's making, and `--overwrite` was refused for good."""
    out = tmp_path / "out"
    begin(out, "complete", {"a": 1}, ["*.ply"]).finish()
    for name in ("0.ply", "1.ply", "notes.txt"):
        (out / name).write_text("")
    with stopped_at_removal(removed, monkeypatch):
        begin(out, "complete", {"a": 2}, ["*.ply"], overwrite=True)
    if removed < 2:
        assert not (out / MARKER).exists()
        for settings in ({"a": 1}, {"a": 2}):
            assert finished(out, "complete", settings, parts=()) is None
            refused(begin, out, "complete", settings, ["*.ply"], match="pass --overwrite again")
    assert not begin(out, "complete", {"a": 2}, ["*.ply"], overwrite=True).resumed
    assert sorted(file.name for file in out.iterdir()) == ["notes.txt", MARKER]
