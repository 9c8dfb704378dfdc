# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""How a script of tables is begun, and what it says where it cannot go on."""

import shlex
import sys
from collections.abc import Callable
from typing import TypeVar

import tyro

from wildshape.errors import BadInputError, MissingExtraError

SettingsT = TypeVar("SettingsT")


def begin(run: Callable[[SettingsT, str], None], settings: type[SettingsT], module: str) -> None:
    """Run a script with the settings of its command line, and tell it that line.

    Args:
        run: the script.
        settings: their record.
        module: that `python -m` runs.
    """
    arguments = sys.argv[1:]
    line = shlex.join(["python", "-m", module, *arguments])
    try:
        run(tyro.cli(settings, args=arguments), line)
    except (BadInputError, MissingExtraError) as error:
        print(error, file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt as stopped:
        print(stopped, file=sys.stderr)
        sys.exit(130)
