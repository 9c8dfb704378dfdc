# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where a result comes from: command, code, libraries, machine, time."""

import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any


def provenance(command: str) -> dict[str, Any]:
    """JSON values that say how a result came about.

    Args:
        command: the command line, as a user would type it again.

    torch is asked only if it is imported already: reading a file must not cost seconds.
    """
    return {
        "command": command,
        "wildshape": _version("wildshape"),
        "code": code_version(),
        "python": platform.python_version(),
        "torch": _version("torch"),
        "numpy": _version("numpy"),
        "hardware": _hardware(),
        "time_utc": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def code_version() -> str:
    """The commit of the checkout that this package runs from, or else the package's version."""
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return _version("wildshape")
    try:
        commit = _git(root, "rev-parse", "HEAD")
        return commit + (" with changes" if _git(root, "status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.SubprocessError):
        return _version("wildshape")


def _git(root: Path, *arguments: str) -> str:
    command = ["git", "-C", str(root), *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, timeout=10
    ).stdout.strip()


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def _hardware() -> dict[str, Any]:
    data: dict[str, Any] = {"cpu": _cpu_model(), "cores": os.cpu_count(), "gpu": None}
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_available():
        data["gpu"] = torch.cuda.get_device_name()
    return data


def _cpu_model() -> str:
    information = Path("/proc/cpuinfo")
    if information.exists():
        for line in information.read_text("utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
