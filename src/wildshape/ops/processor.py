# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What the processor is good at."""

import torch


def multiplies_bf16() -> bool:
    """Whether matrix products in bfloat16 have instructions of their own (and are not slower)."""
    found = torch.cpu.get_capabilities()
    return any(found.get(name, False) for name in ("avx512_bf16", "amx_bf16"))
