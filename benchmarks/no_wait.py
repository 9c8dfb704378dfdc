# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a step recorded as a CUDA graph may not do, watched operation by operation."""

from collections import Counter
from typing import Any

import torch
from torch._ops import OpOverload
from torch.utils._python_dispatch import TorchDispatchMode

# Values read by the host, shapes that depend on values, tensors made of the host's numbers.
FORBIDDEN = (
    "_local_scalar_dense",
    "nonzero",
    "unique",
    "masked_select",
    "bincount",
    "repeat_interleave.Tensor",
    "lift_fresh",
    "is_nonzero",
    "equal",
    "item",
)


# No kernels: memory, shapes, labels for the profiler.
NO_WORK = ("profiler.", "_unsafe_view", "empty")


class WaitError(AssertionError):
    """The operation would make the host wait for the device, or could not be recorded."""


class NoWait(TorchDispatchMode):
    """Raises where a step would wait, if `strict`; counts the operations that are no views."""

    def __init__(self, strict: bool = True) -> None:
        super().__init__()
        self.strict = strict
        self.launched: Counter[str] = Counter()

    def __torch_dispatch__(self, func, types, args=(), kwargs=None):
        name = str(func).removeprefix("aten.")
        if self.strict:
            refuse(func, name, args)
        if not func.is_view and not name.startswith(NO_WORK):
            self.launched[name] += 1
        return func(*args, **(kwargs or {}))


def refuse(func: OpOverload, name: str, args: tuple[Any, ...]) -> None:
    """Raise where an operation waits or its shape depends on values."""
    if any(name == bad or name.startswith(f"{bad}.") for bad in FORBIDDEN):
        raise WaitError(name)
    if name.startswith(("unique", "_unique", "nonzero")):
        raise WaitError(name)
    if name.startswith(("index.", "index_put")):
        if any(index is not None and index.dtype == torch.bool for index in args[1]):
            raise WaitError(f"{name} by a mask")
    elif torch.Tag.dynamic_output_shape in func.tags:
        raise WaitError(f"{name}: its shape depends on values")
