# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How a script of tables is begun, and what it says where it cannot go on."""

import shlex
import sys
from collections.abc import Callable
from typing import TypeVar

import tyro

from wildshape.cli.main import in_a_sentence

SettingsT = TypeVar("SettingsT")


def commit(code: str) -> str:
    """A `code` of provenance as pages say it: seven digits, and whether there were changes."""
    return f"{code[:7]}{' with changes' if code.endswith('changes') else ''}"


def begin(run: Callable[[SettingsT, str], None], settings: type[SettingsT], module: str) -> None:
    """Run a script with the settings of its command line, and tell it that line.

    Args:
        run: the script.
        settings: their record.
        module: that `python -m` runs.
    """
    arguments = sys.argv[1:]
    line = shlex.join(["python", "-m", module, *arguments])
    with in_a_sentence():
        run(tyro.cli(settings, args=arguments), line)
