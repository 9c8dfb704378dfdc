# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One file a command: its `Settings`, `run` and `EXAMPLE`.

Start with `complete`.
"""

from importlib import import_module
from types import ModuleType


def module_of(command: str) -> ModuleType:
    """The module of a command as it is called, for example `evaluate-drive`."""
    return import_module(f"wildshape.cli.commands.{command.replace('-', '_')}")
