# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Complete 3D shapes and 6-DoF poses of objects from one partial scan, without labels."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wildshape.drives.run import drive
    from wildshape.errors import BadInputError, MissingExtraError
    from wildshape.inference.predictor import Predictor, load
    from wildshape.io.scans.writers import save
    from wildshape.records import Box, Completion, Registration, Sensor, Track

__version__ = "0.1.0"
__all__ = [
    "BadInputError",
    "Box",
    "Completion",
    "MissingExtraError",
    "Predictor",
    "Registration",
    "Sensor",
    "Track",
    "drive",
    "load",
    "save",
]

_HOME = {
    "BadInputError": "wildshape.errors",
    "MissingExtraError": "wildshape.errors",
    "Predictor": "wildshape.inference.predictor",
    "drive": "wildshape.drives.run",
    "load": "wildshape.inference.predictor",
    "save": "wildshape.io.scans.writers",
}


def __dir__() -> list[str]:
    """The public names, imported or not, for completion and `help`."""
    return sorted({*globals(), *__all__})


def __getattr__(name: str) -> Any:
    """Import on first use, so that `import wildshape` costs nothing."""
    if name not in __all__:
        raise AttributeError(f"module 'wildshape' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_HOME.get(name, "wildshape.records")), name)
