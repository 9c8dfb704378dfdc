# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Where tensors are computed: which device, what the processor is good at, and its memory."""

import ctypes
import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from mmap import mmap

import torch

from wildshape.errors import BadInputError

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_NEVER = 2**31 - 1
_WORKSPACE_BYTES = 32 << 20


def choose_device(device: str | torch.device) -> str:
    """What torch calls it, made ready; `auto` is the GPU where there is one.

    Raises:
        BadInputError: neither `cpu` nor `cuda`, or torch finds no GPU where one is asked for.
        OSError: a processor without memory for its matrix products.
    """
    device, found = str(device), torch.cuda.is_available()
    if device.startswith("cuda") and not found:
        raise BadInputError(f"--device {device}: torch finds no GPU here; use --device cpu.")
    if device == "auto":
        device = "cuda" if found else "cpu"
    try:
        kind = torch.device(device).type
    except RuntimeError:
        kind = ""
    if kind not in ("cpu", "cuda"):
        raise BadInputError(f"device {device!r}: there are cpu, cuda and auto.")
    if kind == "cpu":
        _take_workspace()
    return device


@contextmanager
def plain_torch() -> Iterator[None]:
    """Inside, in this thread: `inference_mode`, no autocast, and new tensors lie on the CPU.

    Matrix products are float32 in full, of all threads: TF32 knows a car's far end to 2 mm only.
    A result is the same whatever the program around has set. Autograd refuses tensors made here;
    what a caller gets is copied (`SE3.owned`).
    """
    with torch.inference_mode(), ExitStack() as held:
        for kind in ("cpu", "cuda"):
            if torch.is_autocast_enabled(kind):
                held.enter_context(torch.autocast(kind, enabled=False))
        if torch.get_default_device().type != "cpu":
            held.enter_context(torch.device("cpu"))
        on_cpu = torch.backends.mkldnn.matmul  # pyright: ignore[reportAttributeAccessIssue]
        for products in (torch.backends.cuda.matmul, on_cpu):
            if (before := products.fp32_precision) in ("tf32", "bf16"):
                held.callback(setattr, products, "fp32_precision", before)
                products.fp32_precision = "ieee"
        yield


def _take_workspace() -> None:
    """Have MKL take the memory of its matrix products now, and keep it.

    A product that finds no memory later sums in another order without a word, and the last digits
    of a result differ.

    Raises:
        OSError: there is none now.
    """
    mmap(-1, _WORKSPACE_BYTES).close()
    torch.mm(torch.zeros(64, 64), torch.zeros(64, 8192))  # takes as much as any larger one


def keep_memory() -> bool:
    """Tell glibc to reuse freed blocks of any size: 1.5 to 1.8 times faster CPU training.

    Without it each large tensor is mapped afresh and every page faults again. The price: the
    process keeps its peak memory. Both thresholds are needed; either alone does nothing.

    Returns:
        Whether it took effect; False on other C libraries, where nothing is changed.
    """
    if platform.libc_ver()[0] != "glibc":
        return False
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (OSError, AttributeError):
        return False
    mallopt.argtypes, mallopt.restype = [ctypes.c_int, ctypes.c_int], ctypes.c_int
    return all(mallopt(option, _NEVER) == 1 for option in (_M_MMAP_THRESHOLD, _M_TRIM_THRESHOLD))


def multiplies_bf16() -> bool:
    """Whether matrix products in bfloat16 have instructions of their own (and are not slower)."""
    found = torch.cpu.get_capabilities()
    return any(found.get(name, False) for name in ("avx512_bf16", "amx_bf16"))
