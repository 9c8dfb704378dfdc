# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The weights that the package carries, and their names (docs/models.md)."""

from pathlib import Path

from wildshape.errors import BadInputError

_WEIGHTS = Path(__file__).parent.parent / "weights"
SHIPPED = _WEIGHTS / "default.safetensors"


def weights_file(model: str | Path | None) -> Path:
    """The checkpoint meant: a file, shipped weights by name, or those shipped for vehicles.

    A file that exists goes before a name.

    Raises:
        BadInputError: neither; names the weights that are shipped.
    """
    path = Path(model) if model is not None else SHIPPED
    named = _WEIGHTS / f"{path.name}.safetensors"
    bare = path.name == str(path) and not path.exists()
    if bare and named.is_file():
        return named
    if not path.exists():
        shipped = ", ".join(sorted(file.stem for file in _WEIGHTS.glob("*.safetensors")))
        raise BadInputError(
            f"{path}: no such checkpoint; name a .safetensors file, the folder of a run, or one of"
            f" those shipped: {shipped}."
        )
    return path
