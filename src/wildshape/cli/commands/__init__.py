# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One file a command: its `Settings`, `run` and `EXAMPLES`.

Start with `complete`.
"""

import gc
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType


def module_of(command: str) -> ModuleType:
    """The module of a command as it is called, for example `evaluate-drive`."""
    return import_module(f"wildshape.cli.commands.{command.replace('-', '_')}")


@contextmanager
def uncollected() -> Iterator[None]:
    """No collection of garbage inside, nor later of what was imported: a fifth of a cold start.

    Modules live as long as the process, and torch's are many to walk, also when it ends.
    """
    enabled, cold = gc.isenabled(), "torch" not in sys.modules
    gc.disable()
    try:
        yield
    finally:
        if cold:
            gc.freeze()
        if enabled:
            gc.enable()
