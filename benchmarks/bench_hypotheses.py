# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The loss of K pose branches in V views: scored in one pass, one by one, or all differentiated.

    python benchmarks/bench_hypotheses.py [--small]

Each is the whole loss with its gradient to shapes and poses. `one pass` scores all branches of all
views without a graph and differentiates the winners; `a loop` does that branch by branch; `all
differentiated` keeps the graph of every branch and lets autograd find the minimum; `plain` is that
with torch.cdist (benchmarks/plain.py).
"""

from collections.abc import Callable
from functools import partial

import torch
from machine import header
from outcome import Outcome
from plain import apart, explain
from torch import Tensor
from turns import begin, options, take_turns

from wildshape.geometry.transforms.rotation import rotation_from_6d
from wildshape.method.hindsight import score_hypotheses
from wildshape.method.multiview import LossConfig, multiview_loss
from wildshape.ops.device import keep_memory
from wildshape.training.batches.views import Batch
from wildshape.training.recipes import PRESETS

LOSS_BAR, GRADIENT_BAR = 1e-5, 1e-4
Loss = Callable[[Batch, Tensor, Tensor, Tensor, LossConfig], Tensor]


def one_pass(
    batch: Batch, shapes: Tensor, rotation: Tensor, translation: Tensor, config: LossConfig
) -> Tensor:
    """As in training."""
    return multiview_loss(batch.scans, batch.centres, shapes, rotation, translation, config).total


def a_loop(
    batch: Batch, shapes: Tensor, rotation: Tensor, translation: Tensor, config: LossConfig
) -> Tensor:
    """The same, a branch at a time; the winners are then searched again, as nothing is kept."""
    shape = shapes.repeat_interleave(len(batch.scans) // len(shapes), dim=0)
    costs = []
    for R, t in zip(rotation.detach().unbind(1), translation.detach().unbind(1)):
        posed = (shape.detach() @ R.mT + t[:, None])[:, None]
        scores = score_hypotheses(batch.scans, batch.centres, posed, config.projection)
        costs.append(scores.cost(config.beta))
    winner = torch.cat(costs, dim=1).argmin(1)
    rows = torch.arange(len(winner))
    chosen = rotation[rows, winner][:, None], translation[rows, winner][:, None]
    return multiview_loss(batch.scans, batch.centres, shapes, *chosen, config).total


def all_differentiated(
    batch: Batch, shapes: Tensor, rotation: Tensor, translation: Tensor, config: LossConfig
) -> Tensor:
    """The graph of every branch is kept; the minimum chooses."""
    views = len(batch.scans) // len(shapes)
    posed = shapes.repeat_interleave(views, dim=0)[:, None] @ rotation.mT + translation[:, :, None]
    scores = score_hypotheses(batch.scans, batch.centres, posed.detach(), config.projection)
    terms = []
    for k in range(rotation.shape[1]):
        observation = apart(batch.scans, posed[:, k], scores.to_shape[:, k]).mean(1)
        seen = scores.visible[:, k]
        distance = apart(posed[:, k], batch.scans, scores.to_scan[:, k]) * seen
        terms.append(observation + config.beta * distance.sum(1) / seen.sum(1).clamp_min(1))
    return torch.stack(terms, dim=1).amin(1).mean() * views


def plain(
    batch: Batch,
    shapes: Tensor,
    rotation: Tensor,
    translation: Tensor,
    config: LossConfig,
    *,
    exact: bool = False,
) -> Tensor:
    views = len(batch.scans) // len(shapes)
    shape = shapes.repeat_interleave(views, dim=0)
    terms = [
        explain(batch, shape @ R.mT + t[:, None], config, exact=exact)
        for R, t in zip(rotation.unbind(1), translation.unbind(1))
    ]
    return torch.stack(terms, dim=1).amin(1).mean() * views


METHODS: dict[str, Loss] = {
    "one pass": one_pass,
    "a loop": a_loop,
    "all differentiated": all_differentiated,
    "plain": plain,
}


def problem(preset: str) -> tuple[Batch, list[Tensor], LossConfig]:
    """Half-seen ellipsoids ten metres away, and shapes and poses that do not fit them yet."""
    recipe = PRESETS[preset]()
    views, K, m = recipe.views, recipe.network.branches, recipe.network.points
    count, generator = views.tracks * views.views, torch.Generator().manual_seed(0)
    randn = partial(torch.randn, generator=generator)
    car = torch.tensor([2.2, 0.9, 0.7])
    scans = torch.nn.functional.normalize(randn(count, views.points, 3), dim=-1) * car
    scans = torch.cat((-scans[..., :1].abs(), scans[..., 1:]), dim=-1)
    centres = torch.tensor([10.0, 0.0, -1.0]) + randn(count, 3)
    shapes = torch.nn.functional.normalize(randn(views.tracks, m, 3), dim=-1) * car
    rotation = rotation_from_6d(randn(count, K, 6))
    turn = torch.eye(3).expand(count, 3, 3)
    reference = torch.arange(views.tracks) * views.views
    batch = Batch(scans, centres, reference, turn, torch.zeros_like(turn))
    return batch, [shapes, rotation, 0.3 * randn(count, K, 3)], recipe.loss


def differentiate(
    loss: Loss, batch: Batch, inputs: list[Tensor], config: LossConfig
) -> tuple[float, Tensor]:
    """The loss, and its gradient to shapes and poses as one vector."""
    leaves = [x.clone().requires_grad_() for x in inputs]
    value = loss(batch, *leaves, config)
    return value.item(), torch.cat([g.flatten() for g in torch.autograd.grad(value, leaves)])


def measure(outcome: Outcome, preset: str, seconds: float) -> None:
    batch, inputs, config = problem(preset)
    works = {
        name: partial(differentiate, loss, batch, inputs, config) for name, loss in METHODS.items()
    }
    found = {name: work() for name, work in works.items()}
    found["plain"] = differentiate(partial(plain, exact=True), batch, inputs, config)
    value, gradient = found["one pass"]
    off = {name: abs(v - value) / value for name, (v, _) in found.items()}
    apart_by = {
        name: float((g - gradient).norm() / gradient.norm()) for name, (_, g) in found.items()
    }
    shape = f"{len(batch.scans)} x {batch.scans.shape[1]} points, {inputs[0].shape[1]} of shape"
    case = f"{preset}: {shape}, {inputs[1].shape[1]} branches"
    times = take_turns(works, seconds, at_least=3)
    outcome.add(case, times, loss_off=off, gradient_off=apart_by)
    outcome.bar(f"{preset}: loss off plain", off["plain"], LOSS_BAR)
    outcome.bar(f"{preset}: gradient off plain", apart_by["plain"], GRADIENT_BAR)


def main() -> None:
    arguments = begin(options(__doc__))
    keep_memory()
    print(header("bench_hypotheses.py"))
    outcome = Outcome("hypotheses")
    for preset in ("paper-lidar", "small"):
        measure(outcome, preset, 4.0 if arguments.small else 30.0)
    outcome.publish(arguments.out, small=arguments.small)


if __name__ == "__main__":
    main()
