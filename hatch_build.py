# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Compiles the C kernels of `wildshape.ops` into the package when it is installed or built.

No compiler is no error: the wheel is then pure Python, for any platform, and the torch backends do
the work. So it is on Windows, and where WILDSHAPE_NATIVE=0 asks for it. With kernels the wheel is
`py3-none-PLATFORM`: they are called through ctypes, so no version of Python is written into them.
"""

import os
import platform
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import sys_tags

NATIVE = Path("src/wildshape/ops/native")
LIBRARY = "libwildshape_ops.so"
FLAGS = ["-O3", "-fPIC", "-shared", "-ffp-contract=off", "-pthread"]


class NativeBuildHook(BuildHookInterface):
    """Hatch's hook for wheels, editable ones too."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, ship the library, and tag the wheel for this platform alone."""
        reason = unwanted() or _uncompiled(compile_library(Path(self.root) / NATIVE))
        if reason:
            if version == "editable":  # no stale kernels; a wheel has none without `artifacts`
                (Path(self.root) / NATIVE / LIBRARY).unlink(missing_ok=True)
            self.app.display_warning(
                f"Wildshape comes without its native kernels ({reason}); everything works, slower."
            )
            return
        build_data["artifacts"].append(f"/{NATIVE.as_posix()}/{LIBRARY}")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform_tag()}"


def unwanted() -> str:
    """Why no kernels are to be compiled here at all, or nothing."""
    if os.environ.get("WILDSHAPE_NATIVE") == "0":
        return "WILDSHAPE_NATIVE=0"
    return "they need POSIX threads, which Windows lacks" if sys.platform == "win32" else ""


def _uncompiled(reason: str) -> str:
    cure = "; install a C compiler (or set CC) and reinstall to have them"
    return f"{reason}{cure}" if reason else ""


def compile_library(folder: Path) -> str:
    """Compile the C files of a folder into one library there; the reason where it failed."""
    asked = os.environ.get("CC") or "cc"
    try:
        compiler = shlex.split(asked)
    except ValueError:
        compiler = []
    if not compiler:
        return f"CC={asked!r} names no compiler"
    sources = sorted(str(path) for path in folder.glob("*.c"))
    if not os.access(folder, os.W_OK):
        return f"{folder} cannot be written"
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        made = Path(scratch) / LIBRARY
        command = [*compiler, *FLAGS, "-o", str(made), *sources, "-lm"]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
        except FileNotFoundError:
            return f"no C compiler `{compiler[0]}`"
        except (subprocess.SubprocessError, OSError) as error:
            output = (getattr(error, "stderr", "") or str(error)).strip().splitlines()
            return f"`{compiler[0]}` failed: {output[0] if output else 'no message'}"
        made.replace(folder / LIBRARY)
    return ""


def platform_tag() -> str:
    """This machine's plain platform tag; no promise about other distributions (manylinux)."""
    oldest = os.environ.get("MACOSX_DEPLOYMENT_TARGET")
    if sys.platform == "darwin" and oldest:  # what the compiler aims at, not what it runs on
        major, _, minor = oldest.partition(".")
        return f"macosx_{major}_{minor or 0}_{platform.machine()}"
    tags = (tag.platform for tag in sys_tags())
    return next(tag for tag in tags if "manylinux" not in tag and "musllinux" not in tag)
