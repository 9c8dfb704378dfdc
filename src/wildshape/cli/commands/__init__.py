# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""One file a command: its `Settings`, `run` and `EXAMPLES`.

Start with `complete`.
"""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType


def module_of(command: str) -> ModuleType:
    """The module of a command as it is called, for example `evaluate-drive`."""
    return import_module(f"wildshape.cli.commands.{command.replace('-', '_')}")


@contextmanager
def uncollected() -> Iterator[None]:
    """No collection of garbage inside: a fifth of a cold start.

    Modules live as long as the process, and torch's are many to walk.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
