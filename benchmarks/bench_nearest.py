# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Nearest neighbours on the CPU: search both ways, gather, backward; against what else there is.

    python benchmarks/bench_nearest.py            # two minutes
    python benchmarks/bench_nearest.py --small    # half a minute

Competitors are measured if installed (`pip install -e .[bench]`); pykeops too, which wants a C++
compiler when it is first used. All methods take turns. Read the ratios: times depend on the machine
and on its neighbours.
"""

from collections.abc import Callable
from contextlib import suppress
from functools import partial

import torch
from machine import header
from outcome import Outcome
from torch import Tensor
from turns import begin, options, take_turns

from wildshape.ops.library import library
from wildshape.ops.nearest import Neighbours, nearest_distance
from wildshape.ops.nearest.nearest_native import nearest_both_native
from wildshape.ops.nearest.nearest_torch import nearest_blocked, nearest_reference

Index = Callable[[Tensor, Tensor], Tensor]
Step = Callable[[Tensor, Tensor], Tensor]

BARRED = [(32, 1024, 1024), (32, 1024, 2048), (1, 3096, 8192)]
MORE = [(128, 512, 1024), (1, 20000, 30000)]
BARS = [  # shape, ours, theirs, times faster
    (BARRED[0], "native", "pykdtree", 2.5),
    (BARRED[0], "native", "torch.cdist", 20.0),
    (BARRED[1], "native", "pykdtree", 2.0),
    (BARRED[2], "native", "pykdtree", 1.5),
    (BARRED[0], "torch", "torch.cdist", 4.0),
]
LOSS_BAR = 1e-5
COMPETITORS = ("scipy", "pykdtree", "small_gicp", "pykeops")


def ours(a: Tensor, b: Tensor) -> Tensor:
    """Search and distance through the door's own differentiable form."""
    there, back = nearest_both_native(a.detach(), b.detach())
    return nearest_distance(a, b, there).mean() + nearest_distance(b, a, back).mean()


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


def keops(outcome: Outcome) -> dict[str, Step]:
    """pykeops, once it has compiled its formula; nothing where it cannot."""
    try:
        import pykeops
        from pykeops.torch import LazyTensor

        pykeops.set_verbose(False)

        def index(a: Tensor, b: Tensor) -> Tensor:
            apart = LazyTensor(a[:, :, None].contiguous()) - LazyTensor(b[:, None].contiguous())
            return (apart**2).sum(-1).argmin(2)[..., 0]

        index(torch.zeros(1, 2, 3), torch.zeros(1, 2, 3))
    except ImportError:
        return {}
    except Exception as error:  # noqa: BLE001, its compilers fail in ways of their own
        outcome.note(f"pykeops is installed but does not run here ({type(error).__name__})")
        return {}
    return {"pykeops": gathered(index)}


def candidates(threads: int, outcome: Outcome, *, slow: bool) -> dict[str, Step]:
    found = {"torch": ours_plain(nearest_blocked), "torch.cdist": cdist}
    if slow:
        found["reference"] = ours_plain(nearest_reference)
    if library():
        found = {"native": ours} | found
    return found | trees(threads) | keops(outcome)


def measure(outcome: Outcome, methods: dict[str, Step], shape: tuple, seconds: float) -> None:
    """One table: forward and backward of each method, and how far its loss is off the first's."""
    generator = torch.Generator().manual_seed(0)
    B, N, M = shape
    a, b = (shell(B, n, generator).requires_grad_() for n in (N, M))
    losses = {name: step(a, b).item() for name, step in methods.items()}
    first = next(iter(losses.values()))
    off = {name: abs(loss - first) / first for name, loss in losses.items()}
    times = take_turns({name: partial(turn, step, a, b) for name, step in methods.items()}, seconds)
    outcome.add(case(shape), times, loss_off=off)
    mine = max(off[name] for name in ("native", "torch", "reference") if name in off)
    outcome.bar(f"{case(shape)}: losses of our own ways off each other", mine, LOSS_BAR)


def case(shape: tuple[int, int, int]) -> str:
    return f"{shape[0]} x ({shape[1]} and {shape[2]} points)"


def turn(step: Step, a: Tensor, b: Tensor) -> None:
    a.grad = b.grad = None
    step(a, b).backward()


def shell(B: int, n: int, generator: torch.Generator) -> Tensor:
    """Points on a car-sized ellipsoid with a centimetre of noise."""
    points = torch.nn.functional.normalize(torch.randn(B, n, 3, generator=generator), dim=-1)
    return points * torch.tensor([2.2, 0.9, 0.7]) + 0.01 * torch.randn(B, n, 3, generator=generator)


def main() -> None:
    arguments = begin(options(__doc__))
    print(header("bench_nearest.py"))
    outcome = Outcome("nearest")
    methods = candidates(arguments.threads, outcome, slow=not arguments.small)
    if "native" not in methods:
        outcome.note("native: not built (a C compiler was missing when Wildshape was installed)")
    for name in COMPETITORS:
        if name not in methods:
            outcome.note(f"{name}: not installed, not measured")
    for shape in BARRED + ([] if arguments.small else MORE):
        # All distances of the largest clouds at once would take gigabytes.
        fitting = {k: v for k, v in methods.items() if shape[1] < 10_000 or k != "torch.cdist"}
        measure(outcome, fitting, shape, 5.0 if arguments.small else 20.0)
    for shape, fast, slow, times in BARS:
        outcome.at_least(case(shape), fast, slow, times)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
