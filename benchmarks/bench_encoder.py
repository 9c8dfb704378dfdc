# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The encoder forward and backward: through the winners, dense, and as a paper's appendix draws it.

    python benchmarks/bench_encoder.py [--small]

`winners` is what training on a CPU uses, `dense` is autograd through the same module, `literal` is
Conv1d with the pooled feature copied to each point. Clouds are drawn with replacement, as training
draws them, from scans of 1.14 times as many points. All have the allocator's setting of training;
bench_step.py has one row without. Gradients are compared in float64.
"""

import copy
from collections.abc import Callable
from functools import partial

import torch
from machine import header
from outcome import Outcome
from plain import gradients_as_ours, twin_of
from torch import Tensor
from turns import begin, options, take_turns

from wildshape.method.encoders.pcn_winners import encode_winners
from wildshape.method.network import ShapePoseNet
from wildshape.ops.device import keep_memory
from wildshape.training.recipes import PRESETS

GRADIENT_BAR = 1e-10


def methods(network: ShapePoseNet) -> dict[str, Callable[[Tensor], Tensor]]:
    return {
        "winners": partial(encode_winners, network.encoder),
        "dense": network.encoder,
        "literal": scaled(twin_of(network).encode, network.config.scale),
    }


def scaled(encode: Callable[[Tensor], Tensor], scale: float) -> Callable[[Tensor], Tensor]:
    """The plain network divides by its scale itself; here points come divided."""
    return lambda points: encode(points * scale)


def scans(count: int, points: int) -> Tensor:
    """Clouds of which each point is one of 1.14 times as many: 681 of 1024 are distinct."""
    generator = torch.Generator().manual_seed(0)
    whole = torch.randn(count, round(1.14 * points), 3, generator=generator)
    drawn = torch.randint(whole.shape[1], (count, points, 1), generator=generator)
    return whole.gather(1, drawn.expand(-1, -1, 3))


def turn(network: torch.nn.Module, encode: Callable[[Tensor], Tensor], points: Tensor) -> None:
    network.zero_grad(set_to_none=True)
    encode(points).square().mean().backward()


def gradients(network: ShapePoseNet, points: Tensor) -> dict[str, Tensor]:
    """The encoder's gradient of each method in float64, as one vector."""
    network, points = copy.deepcopy(network).double(), points.double()
    plain = twin_of(network).double()
    found = {}
    for name, encode in (
        methods(network) | {"literal": scaled(plain.encode, network.config.scale)}
    ).items():
        turn(network, encode, points)
        held = dict(network.named_parameters())
        grads = {key: p.grad for key, p in held.items() if p.grad is not None}
        if name == "literal":
            for parameter in plain.parameters():  # the decoders', which have none
                parameter.grad = (
                    torch.zeros_like(parameter) if parameter.grad is None else parameter.grad
                )
            grads = gradients_as_ours(plain, network)
        found[name] = torch.cat(
            [grads[key].flatten() for key in sorted(held) if key.startswith("encoder.")]
        )
    return found


def measure(outcome: Outcome, preset: str, seconds: float) -> None:
    recipe = PRESETS[preset]()
    torch.manual_seed(0)
    network = ShapePoseNet(recipe.network)
    count = recipe.views.tracks * recipe.views.views
    points = scans(count, recipe.views.points) / recipe.network.scale
    case = f"{preset}: {count} x {recipe.views.points} points, widths {recipe.network.encoder}"
    works = {
        name: partial(turn, network, encode, points) for name, encode in methods(network).items()
    }
    found = gradients(network, points)
    size = found["dense"].norm()
    off = {name: float((g - found["dense"]).norm() / size) for name, g in found.items()}
    outcome.add(case, take_turns(works, seconds, at_least=3), gradient_off=off)
    outcome.bar(f"{preset}: gradient off dense autograd, float64", off["winners"], GRADIENT_BAR)


def main() -> None:
    arguments = begin(options(__doc__))
    keep_memory()
    print(header("bench_encoder.py"))
    outcome = Outcome("encoder")
    for preset in ("small",) if arguments.smoke else ("paper-lidar", "small"):
        measure(outcome, preset, 5.0 if arguments.small else 30.0)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
