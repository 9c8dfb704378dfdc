# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility on the CPU: the compiled pass against plain torch.

python benchmarks/bench_zbuffer.py [--small] [--threads N]
"""

import argparse
import time

import torch

from wildshape.ops.library import library
from wildshape.ops.zbuffer_native import visible_native
from wildshape.ops.zbuffer_torch import visible_reference

SHAPES = [(128, 512, 131072), (128, 2048, 131072), (128, 2048, 4096), (1, 8192, 16384)]
SMALL = [(16, 512, 131072), (4, 512, 1024)]


def milliseconds(backend, shape: tuple[int, int, int], repeats: int) -> float:
    B, N, n_bins = shape
    generator = torch.Generator().manual_seed(0)
    bins = torch.randint(0, n_bins, (B, N), generator=generator) // 4
    depth = torch.rand(B, N, generator=generator)
    times: list[float] = []
    for _ in range(repeats + 1):
        start = time.perf_counter()
        backend(bins, depth, n_bins)
        times.append(time.perf_counter() - start)
    return 1e3 * min(times[1:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="under a second")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    backends = {"torch": visible_reference} | ({"native": visible_native} if library() else {})
    print(
        f"threads {arguments.threads}\n{'B, N, bins':<24}" + "".join(f"{n:>12}" for n in backends)
    )
    for shape in SMALL if arguments.small else SHAPES:
        repeats = 3 if arguments.small else 20
        cells = [milliseconds(backend, shape, repeats) for backend in backends.values()]
        print(f"{shape!s:<24}" + "".join(f"{ms:>9.3f} ms" for ms in cells))


if __name__ == "__main__":
    main()
