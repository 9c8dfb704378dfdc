# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest-in-bin visibility on the CPU: the compiled pass, plain torch, and an image by scatter.

python benchmarks/bench_zbuffer.py [--small]
"""

from functools import partial

import torch
from machine import header
from outcome import Outcome
from torch import Tensor
from turns import begin, options, take_turns

from wildshape.ops.library import library
from wildshape.ops.zbuffer.zbuffer_native import visible_native
from wildshape.ops.zbuffer.zbuffer_torch import visible_reference

SHAPES = [(128, 512, 131072), (128, 2048, 131072), (128, 2048, 4096), (1, 8192, 16384)]
SMALL = SHAPES[1:3]


def image(bins: Tensor, depth: Tensor, n_bins: int) -> Tensor:
    """What one writes first: an image of minima; points that tie are all seen."""
    nearest = depth.new_full((len(bins), n_bins), torch.inf)
    nearest.scatter_reduce_(1, bins, depth, "amin")
    return depth <= nearest.gather(1, bins)


def measure(outcome: Outcome, shape: tuple[int, int, int], seconds: float) -> None:
    B, N, n_bins = shape
    generator = torch.Generator().manual_seed(0)
    bins = torch.randint(0, n_bins, (B, N), generator=generator) // 4
    depth = torch.rand(B, N, generator=generator)
    methods = {"torch": visible_reference, "image by scatter": image}
    if library():
        methods = {"native": visible_native} | methods
    works = {name: partial(method, bins, depth, n_bins) for name, method in methods.items()}
    expected = visible_reference(bins, depth, n_bins)
    differ = {name: int((work() != expected).sum()) for name, work in works.items()}
    case = f"{B} x {N} points, {n_bins} bins"
    outcome.add(case, take_turns(works, seconds), points_off=differ)
    outcome.bar(f"{case}: points off the reference", next(iter(differ.values())), 0)


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_zbuffer.py"))
    outcome = Outcome("zbuffer")
    for shape in SMALL if arguments.small else SHAPES:
        measure(outcome, shape, 1.0 if arguments.small else 5.0)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
