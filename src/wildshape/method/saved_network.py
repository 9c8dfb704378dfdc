# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A network in a safetensors file: nothing is built of what does not fit, nor of no numbers."""

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from wildshape.errors import BadInputError
from wildshape.io.guard import first_line

Net = TypeVar("Net", bound=nn.Module)
Settings = TypeVar("Settings")
_FLOATS = ("F16", "BF16", "F32", "F64")
_CHECKSUM = "sha256"
_DRAWS = (Tensor.uniform_, Tensor.normal_)
_MOST = 1e9
_CURE = "take another copy of the file, or train it again"


@dataclass(frozen=True)
class Format(Generic[Net, Settings]):
    """What a file of some kind holds.

    Attributes:
        name: in its metadata.
        version: likewise.
        source: of such files, in words.
        settings: from the JSON values of its metadata; raises ValueError.
        build: the network that the settings describe.
    """

    name: str
    version: int
    source: str
    settings: Callable[[object], Settings]
    build: Callable[[Settings], Net]


def load_network(path: Path, form: Format[Net, Settings]) -> tuple[Net, Settings]:
    """The network in evaluation mode, its weights float32, and its settings.

    Raises:
        BadInputError: no such file, no safetensors, another format or version, damaged settings,
            weights missing, of another shape, no numbers, or not those that were saved.
    """
    if not path.is_file():
        raise BadInputError(f"{path}: no such checkpoint; give --model a .safetensors file.")
    try:
        with safe_open(path, framework="pt") as file:
            settings = _settings(path, file.metadata() or {}, form)
            with torch.device("meta"), _Undrawn():
                expected = form.build(settings).float().state_dict()
            check_shapes(path, file, expected)
            stored = {name: file.get_tensor(name) for name in expected}
            metadata = file.metadata()
    except BadInputError:
        raise
    except (SafetensorError, OSError, ValueError) as error:
        said = first_line(error)
        raise BadInputError(
            f"{path}: not a readable safetensors file ({said}); {form.source}."
        ) from error
    weights = {name: values.to(expected[name].dtype) for name, values in stored.items()}
    check_numbers(path, weights)
    check_sum(path, stored, metadata["settings"], metadata)
    with torch.device("cpu"), torch.random.fork_rng(devices=()), _Undrawn():
        network = form.build(settings).float()
    network.load_state_dict(weights)
    return network.eval(), settings


class _Undrawn(TorchFunctionMode):
    """Weights are not drawn at random where those of a file replace them at once."""

    def __torch_function__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: Any = None
    ) -> Any:
        given = kwargs or {}
        if func in _DRAWS:  # zeros: who draws anew until all are in bounds comes to an end
            return args[0].zero_()
        if getattr(func, "__module__", "") == nn.init.__name__:
            return given.get("tensor", *args[:1])
        return func(*args, **given)


def packed_network(weights: Mapping[str, Tensor], metadata: dict[str, str]) -> bytes:
    """A safetensors file of weights on the CPU and of its metadata, with their checksum."""
    return packed(weights, metadata["settings"], metadata)


def packed(tensors: Mapping[str, Tensor], said: str, metadata: dict[str, str]) -> bytes:
    """The same of any tensors; `said`: what of the metadata is summed with them."""
    return save(dict(tensors), metadata | {_CHECKSUM: _sum_of(tensors, said)})


def _sum_of(tensors: Mapping[str, Tensor], said: str) -> str:
    found = hashlib.sha256(said.encode())
    for name in sorted(tensors):
        found.update(name.encode())
        found.update(tensors[name].contiguous().flatten().view(torch.uint8).numpy().data)
    return found.hexdigest()


def check_sum(
    path: Path, tensors: Mapping[str, Tensor], said: str, metadata: Mapping[str, str]
) -> None:
    """Compare with the checksum of `packed`; files of older versions have none.

    Raises:
        BadInputError: they are not what was written.
    """
    if metadata.get(_CHECKSUM) not in (None, _sum_of(tensors, said)):
        raise BadInputError(f"{path}: the checksum is wrong, the file is damaged; {_CURE}.")


def unsummed(metadata: Mapping[str, str]) -> dict[str, str]:
    """The metadata as given to `packed`."""
    return {name: value for name, value in metadata.items() if name != _CHECKSUM}


def _settings(path: Path, metadata: dict[str, str], form: Format[Any, Settings]) -> Settings:
    found = f"{metadata.get('format', 'no format')} version {metadata.get('version', 'none')}"
    if found != f"{form.name} version {form.version}":
        raise BadInputError(
            f"{path}: expected a {form.name} of version {form.version}, found"
            f" {found[:80]}; {form.source}."
        )
    try:
        return form.settings(json.loads(metadata["settings"]))
    except (KeyError, ValueError, RecursionError) as error:
        said = first_line(error).rstrip(".")
        raise BadInputError(f"{path}: its settings are damaged: {said}; {_CURE}.") from error


def check_shapes(path: Path, file: Any, expected: dict[str, Tensor]) -> None:
    """Compare what an open safetensors file promises with what is expected; nothing is read.

    Args:
        path: of the file.
        file: `safe_open`'s.
        expected: tensors of the shapes and kinds expected, on any device.

    Raises:
        BadInputError: tensors are missing, unexpected, or of another shape or kind.
    """
    found = set(file.keys())
    missing, extra = sorted(set(expected) - found), sorted(found - set(expected))
    wrong = [n for n in expected if n in found and not _fits(file.get_slice(n), expected[n])]
    if missing or extra or wrong:
        raise BadInputError(
            f"{path}: weights do not fit the network; missing {_few(missing)}, unexpected"
            f" {_few(extra)}, of another shape {_few(wrong)}; {_CURE}."
        )


def _fits(promised: Any, expected: Tensor) -> bool:
    is_float = promised.get_dtype() in _FLOATS
    shape = tuple(promised.get_shape())
    return shape == tuple(expected.shape) and is_float == expected.is_floating_point()


def _few(names: list[str]) -> str:
    shown = [name[:60] for name in names[:4]]
    return f"{shown}{' ...' if len(names) > 4 else ''}" if names else "none"


def check_numbers(path: Path, tensors: dict[str, Tensor]) -> None:
    """Refuse NaN, infinity, and numbers so large that they soon become infinite.

    Raises:
        BadInputError: a tensor has some.
    """
    for name, values in tensors.items():
        low, high = values.aminmax() if values.numel() else (0.0, 0.0)
        if not (low >= -_MOST and high <= _MOST):  # of NaN neither is true
            raise BadInputError(f"{path}: {name} holds values that are no numbers; {_CURE}.")
