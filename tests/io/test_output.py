# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import json
import subprocess
import sys

from wildshape.io.output import provenance


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
