# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Chamfer step on the CPU: search both ways, gather, backward; against what else there is.

python benchmarks/bench_nearest.py [--small] [--threads N]

Competitors are measured if installed: pip install pykdtree small_gicp scipy. Read the ratios;
the times depend on the machine and on its neighbours.
"""

import argparse
import time
from collections.abc import Callable
from contextlib import suppress

import torch
from torch import Tensor

from wildshape.ops.library import library
from wildshape.ops.nearest import Neighbours, nearest_distance
from wildshape.ops.nearest_native import nearest_native
from wildshape.ops.nearest_torch import nearest_blocked, nearest_reference

Index = Callable[[Tensor, Tensor], Tensor]
Step = Callable[[Tensor, Tensor], Tensor]

SHAPES = [(32, 1024, 1024), (32, 1024, 2048), (1, 3096, 8192)]
SMALL = [(4, 512, 512), (1, 1024, 2048)]
BARS = {  # ratio of the second's time to the first's, at (B, N, M)
    ("native", "pykdtree"): {SHAPES[0]: 2.5, SHAPES[1]: 2.0, SHAPES[2]: 1.5},
    ("native", "torch.cdist"): {SHAPES[0]: 20.0},
    ("torch", "torch.cdist"): {SHAPES[0]: 4.0},
}


def ours(search: Callable[[Tensor, Tensor], Neighbours]) -> Step:
    """Search and distance through the door's own differentiable form."""

    def step(a: Tensor, b: Tensor) -> Tensor:
        there, back = search(a.detach(), b.detach()), search(b.detach(), a.detach())
        return nearest_distance(a, b, there).mean() + nearest_distance(b, a, back).mean()

    return step


def ours_plain(search: Callable[[Tensor, Tensor], Neighbours]) -> Step:
    """The same with the gather and the gradient of torch too, as without the library."""
    return gathered(lambda a, b: search(a, b).index)


def gathered(index: Index) -> Step:
    """A competitor's indices, gathered and differentiated by torch."""

    def one_way(a: Tensor, b: Tensor) -> Tensor:
        chosen = index(a.detach(), b.detach())[..., None].expand(-1, -1, 3)
        return (a - b.gather(1, chosen)).square().sum(-1).clamp_min(1e-20).sqrt().mean()

    return lambda a, b: one_way(a, b) + one_way(b, a)


def cdist(a: Tensor, b: Tensor) -> Tensor:
    """What one writes first: distances of each pair of clouds, minimum, autograd through it."""
    clouds = [torch.cdist(x, y) for x, y in zip(a, b)]
    there = torch.stack([d.min(1).values.mean() for d in clouds]).mean()
    return there + torch.stack([d.min(0).values.mean() for d in clouds]).mean()


def trees(threads: int) -> dict[str, Step]:
    """KD-trees, one a cloud and direction, those that are installed."""
    found: dict[str, Step] = {}
    with suppress(ImportError):
        from scipy.spatial import cKDTree

        found["scipy"] = gathered(per_cloud(lambda x, y: cKDTree(y).query(x, workers=threads)[1]))
    with suppress(ImportError):
        from pykdtree.kdtree import KDTree

        found["pykdtree"] = gathered(per_cloud(lambda x, y: KDTree(y).query(x)[1].astype("int64")))
    with suppress(ImportError):
        import small_gicp

        def query(x, y):
            tree = small_gicp.KdTree(y.astype("float64"), num_threads=threads)
            return tree.batch_nearest_neighbor_search(x.astype("float64"), num_threads=threads)[0]

        found["small_gicp"] = gathered(per_cloud(query))
    return found


def per_cloud(query: Callable) -> Index:
    return lambda a, b: torch.stack(
        [torch.as_tensor(query(x.numpy(), y.numpy())).long().reshape(-1) for x, y in zip(a, b)]
    )


def candidates(threads: int) -> dict[str, Step]:
    found = {"torch": ours_plain(nearest_blocked), "reference": ours_plain(nearest_reference)}
    if library():
        found = {"native": ours(nearest_native)} | found
    return found | {"torch.cdist": cdist} | trees(threads)


def measure(
    methods: dict[str, Step], shape: tuple[int, int, int], seconds: float
) -> dict[str, tuple[float, float]]:
    """Milliseconds of forward and backward, and the loss, for each method.

    All methods take turns, so that busy neighbours hit them alike; the best turn counts.
    """
    B, N, M = shape
    generator = torch.Generator().manual_seed(0)
    a, b = (shell(B, n, generator).requires_grad_() for n in (N, M))
    results = dict.fromkeys(methods, (float("inf"), 0.0))
    end, rounds = time.perf_counter() + seconds, 0
    while rounds < 3 or time.perf_counter() < end:
        rounds += 1
        for name, step in methods.items():
            for _ in range(5 if name == "native" else 1):
                ms, loss = turn(step, a, b)
                results[name] = (min(results[name][0], ms), loss)
    return results


def turn(step: Step, a: Tensor, b: Tensor) -> tuple[float, float]:
    a.grad = b.grad = None
    start = time.perf_counter()
    loss = step(a, b)
    loss.backward()
    return 1e3 * (time.perf_counter() - start), loss.item()


def shell(B: int, n: int, generator: torch.Generator) -> Tensor:
    """Points on a car-sized ellipsoid with a centimetre of noise."""
    points = torch.nn.functional.normalize(torch.randn(B, n, 3, generator=generator), dim=-1)
    return points * torch.tensor([2.2, 0.9, 0.7]) + 0.01 * torch.randn(B, n, 3, generator=generator)


def report(shape: tuple[int, int, int], results: dict[str, tuple[float, float]]) -> None:
    first = next(iter(results.values()))
    print(f"\nB, N, M = {shape}: search both ways + gather + backward")
    print(f"{'method':<14}{'ms':>10}{'x ' + next(iter(results)):>12}")
    for name, (ms, loss) in results.items():
        drift = abs(loss - first[1]) / first[1]
        note = f"   loss off by {drift:.0e}" if drift > 1e-5 else ""
        print(f"{name:<14}{ms:>10.2f}{ms / first[0]:>12.1f}{note}")
    for (fast, slow), bars in BARS.items():
        if shape in bars and fast in results and slow in results:
            ratio = results[slow][0] / results[fast][0]
            verdict = "met" if ratio >= bars[shape] else "MISSED"
            print(f"bar: {fast} >= {bars[shape]} x {slow}: {ratio:.1f} {verdict}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="a few seconds")
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    methods = candidates(arguments.threads)
    absent = {"native", "scipy", "pykdtree", "small_gicp"} - set(methods)
    print(f"threads {arguments.threads}; not installed: {', '.join(sorted(absent)) or 'none'}")
    for shape in SMALL if arguments.small else SHAPES:
        report(shape, measure(methods, shape, 0.3 if arguments.small else 15.0))


if __name__ == "__main__":
    main()
