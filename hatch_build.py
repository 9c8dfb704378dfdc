# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Compiles the C kernels of `wildshape.ops` into the package when it is installed or built.

No compiler is no error: the wheel is then pure Python and the torch backends do the work.
"""

import os
import shlex
import subprocess
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

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002
        """Compile, ship the library, and tag the wheel for this platform alone."""
        reason = compile_library(Path(self.root) / NATIVE)
        if reason:
            (Path(self.root) / NATIVE / LIBRARY).unlink(missing_ok=True)  # no stale kernels
            self.app.display_warning(
                f"Wildshape is installed without its native kernels ({reason}): everything works, "
                "slower; install a C compiler (or set CC) and reinstall to have them."
            )
            return
        build_data["artifacts"].append(f"/{NATIVE.as_posix()}/{LIBRARY}")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform_tag()}"


def compile_library(folder: Path) -> str:
    """Compile the C files of a folder into one library there; the reason where it failed."""
    compiler = shlex.split(os.environ.get("CC") or "cc")
    sources = sorted(str(path) for path in folder.glob("*.c"))
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
    tags = (tag.platform for tag in sys_tags())
    return next(tag for tag in tags if "manylinux" not in tag and "musllinux" not in tag)
