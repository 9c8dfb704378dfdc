# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The weights that the package carries, and their names (docs/models.md)."""

from pathlib import Path

_WEIGHTS = Path(__file__).parent.parent / "weights"
SHIPPED = _WEIGHTS / "default.safetensors"


def weights_file(model: str | Path | None) -> Path:
    """The checkpoint meant: a file, shipped weights by name, or those shipped for vehicles.

    A file that exists goes before a name.
    """
    path = Path(model) if model is not None else SHIPPED
    named = _WEIGHTS / f"{path.name}.safetensors"
    bare = path.name == str(path) and not path.exists()
    return named if bare and named.is_file() else path
