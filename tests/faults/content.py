# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What an output says, without when and how fast it was made: equal for equal work.

Of a training log the order of the steps alone: its means begin anew where a run went on.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

from safetensors import safe_open

_PASSING = {
    "seconds",
    "steps_per_second",
    "time_utc",
    "provenance",
    "time",
    "command",
    "code",
    "checksum",
}


def content(out: Path) -> dict[str, Any]:
    """All files below a folder by their names; curves for TensorBoard are not looked into."""
    files = sorted(file for file in out.rglob("*") if file.is_file())
    named = {str(file.relative_to(out)): file for file in files}
    return {name: read(file) for name, file in named.items() if "tensorboard" not in name}


def read(file: Path) -> Any:
    """The content of one file; whatever is torn raises."""
    match file.suffix:
        case ".json":
            return _lasting(json.loads(file.read_text("utf-8")))
        case ".jsonl":
            steps = [json.loads(line)["step"] for line in file.read_text("utf-8").splitlines()]
            return {"last": steps[-1:], "in_order": steps == sorted(steps)}
        case ".safetensors":
            return _tensors(file)
        case _:
            return hashlib.sha256(file.read_bytes()).hexdigest()


def _tensors(file: Path) -> dict[str, str]:
    """Digests of tensors, their names and shapes."""
    with safe_open(file, framework="numpy") as opened:
        found = {name: opened.get_tensor(name) for name in opened.keys()}  # noqa: SIM118
        step = (opened.metadata() or {}).get("step", "")
    told = {
        name: f"{array.dtype} {array.shape} {hashlib.sha256(array.tobytes()).hexdigest()}"
        for name, array in found.items()
    }
    return told | {"step": step}


def _lasting(data: Any) -> Any:
    if isinstance(data, dict):
        return {key: _lasting(value) for key, value in data.items() if key not in _PASSING}
    return [_lasting(value) for value in data] if isinstance(data, list) else data


def under_final_names(out: Path) -> dict[str, Path]:
    """Files that claim to be whole: neither they nor a folder of theirs is marked as unfinished."""
    found = {}
    for file in out.rglob("*"):
        parts = file.relative_to(out).parts
        if file.is_file() and not any(p.startswith(".") or p.endswith(".part") for p in parts):
            found["/".join(parts)] = file
    return {name: file for name, file in found.items() if "tensorboard" not in name}


def differences(found: dict[str, Any], expected: dict[str, Any]) -> list[str]:
    """Names of files that are missing, too many or of another content."""
    names = sorted(found.keys() | expected.keys())
    absent = object()
    return [n for n in names if found.get(n, absent) != expected.get(n, absent)]
