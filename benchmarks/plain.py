# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The plain twin of a training step: what one writes first, to measure against and to check with.

Conv1d and Linear modules, the pooled feature copied to each point, `torch.cdist` and `argmin` for
every branch, a z-buffer by scatter, and autograd through all of it. The bins of the image and the
handicap of turning branches are plain torch already and are shared.
"""

from collections.abc import Iterator

import torch
from torch import Tensor, nn

from wildshape.geometry.projection.visibility import Projection, bin_points
from wildshape.geometry.transforms.rotation import rotation_from_6d
from wildshape.method.multiview import LossConfig
from wildshape.method.network import NetworkConfig, ShapePoseNet
from wildshape.training.batches.views import Batch
from wildshape.training.objectives import turning_handicap

_SMALLEST = 1e-12
_MODES = {False: "use_mm_for_euclid_dist_if_necessary", True: "donot_use_mm_for_euclid_dist"}


class PlainNet(nn.Module):
    """`ShapePoseNet` as a paper's appendix draws it."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        a, b, c, d = config.encoder
        self.conv1, self.conv2 = nn.Conv1d(3, a, 1), nn.Conv1d(a, b, 1)
        self.conv3, self.conv4 = nn.Conv1d(2 * b, c, 1), nn.Conv1d(c, d, 1)
        points = config.points // 2 if config.mirror else config.points
        self.shape = mlp(d, config.decoder, 3 * points)
        out = 10 if config.selector else 9
        self.branches = nn.ModuleList(mlp(d, config.pose, out) for _ in range(config.branches))

    def encode(self, scans: Tensor) -> Tensor:
        """`(B, d)` codes of `(B, N, 3)` centred scans, metres."""
        columns = (scans / self.config.scale).transpose(1, 2)
        local = self.conv2(self.conv1(columns).relu())
        pooled = local.max(2, keepdim=True).values.expand(-1, -1, local.shape[2])
        joined = self.conv3(torch.cat((local, pooled), dim=1)).relu()
        return self.conv4(joined).max(2).values

    def canonical(self, code: Tensor) -> Tensor:
        """`(B, P, 3)` canonical points, metres."""
        points = self.shape(code).view(len(code), -1, 3) * self.config.scale
        if not self.config.mirror:
            return points
        return torch.cat((points, points * points.new_tensor((1.0, -1.0, 1.0))), dim=1)

    def poses(self, code: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """`(B, K, 3, 3)` rotations, `(B, K, 3)` translations, `(B, K)` log-beliefs."""
        out = torch.stack([branch(code) for branch in self.branches], dim=1)
        logits = out[..., 9] if self.config.selector else torch.zeros_like(out[..., 0])
        translation = out[..., 6:9] * self.config.scale
        return rotation_from_6d(out[..., :6]), translation, logits.log_softmax(-1)


def mlp(size: int, widths: tuple[int, int], out: int) -> nn.Sequential:
    a, b = widths
    return nn.Sequential(
        nn.Linear(size, a), nn.ReLU(), nn.Linear(a, b), nn.ReLU(), nn.Linear(b, out)
    )


def plain_loss(net: PlainNet, batch: Batch, config: LossConfig, *, exact: bool = False) -> Tensor:
    """The same loss as `training.objectives.WeaklySupervised`.

    `exact` is for comparing, not for timing: torch.cdist goes by way of a matrix product, whose
    rounding here and there makes another point the nearest.
    """
    code = net.encode(batch.scans)
    rotation, translation, log_belief = net.poses(code)
    shapes = net.canonical(code[batch.reference])
    views = len(batch.scans) // len(shapes)
    shape = shapes.repeat_interleave(views, dim=0)
    terms = [
        explain(batch, shape @ R.mT + t[:, None], config, exact=exact)
        for R, t in zip(rotation.unbind(1), translation.unbind(1))
    ]
    cost = torch.stack(terms, dim=1)
    winner = (cost.detach() + handicap(batch, rotation, cost, log_belief, config)).argmin(1)
    loss = cost.gather(1, winner[:, None]).mean() * views
    return loss - config.belief * log_belief.gather(1, winner[:, None]).mean()


def explain(batch: Batch, posed: Tensor, config: LossConfig, *, exact: bool = False) -> Tensor:
    """`(B,)` label-free cost of one branch's posed shapes `(B, P, 3)` (paper eq. 2 and 3)."""
    scans = batch.scans
    with torch.no_grad():
        distance = torch.cdist(scans, posed, compute_mode=_MODES[exact])
        to_shape, to_scan = distance.argmin(2), distance.argmin(1)
        seen = in_front(posed, batch.centres, config.projection)
    observation = apart(scans, posed, to_shape).mean(1)
    projection = (apart(posed, scans, to_scan) * seen).sum(1) / seen.sum(1).clamp_min(1)
    return observation + config.beta * projection


def apart(source: Tensor, target: Tensor, index: Tensor) -> Tensor:
    found = target.gather(1, index[..., None].expand(-1, -1, 3))
    return (source - found).square().sum(-1).clamp_min(_SMALLEST).sqrt()


def in_front(posed: Tensor, centres: Tensor, projection: Projection) -> Tensor:
    """`(B, P)`: the nearest point of each bin of the sensor's image."""
    bins = bin_points(posed + centres[:, None], centres, projection)
    inside = bins.index >= 0
    index, depth = bins.index.clamp_min(0), bins.depth.masked_fill(~inside, torch.inf)
    image = depth.new_full((len(depth), bins.count), torch.inf)
    image.scatter_reduce_(1, index, depth, "amin")
    return inside & (depth <= image.gather(1, index))


@torch.no_grad()
def handicap(
    batch: Batch, rotation: Tensor, cost: Tensor, log_belief: Tensor, config: LossConfig
) -> Tensor:
    """`(B, K)` metres that keep a track from turning around between its scans."""
    if not config.time_ordered:
        return torch.zeros_like(cost)
    anchor = batch.anchor
    if not anchor.any():
        at = batch.reference
        branch = (cost[at] - config.belief * log_belief[at]).argmin(1)
        own = rotation[at, branch]
        anchor = (batch.turn[at].mT @ own).repeat_interleave(len(cost) // len(at), dim=0)
    return turning_handicap(rotation, batch.turn, anchor)


def pairs(
    plain: dict[str, Tensor], ours: dict[str, Tensor], config: NetworkConfig
) -> Iterator[tuple[Tensor, Tensor]]:
    """Views of the same numbers in both networks' tensors (weights or gradients), by name."""
    layers = {"point1": "conv1", "point2": "conv2", "point4": "conv4"}
    for name, conv in layers.items():
        yield plain[f"{conv}.weight"][..., 0], ours[f"encoder.{name}.weight"]
        yield plain[f"{conv}.bias"], ours[f"encoder.{name}.bias"]
    b = config.encoder[1]
    yield plain["conv3.weight"][:, :b, 0], ours["encoder.join_point.weight"]
    yield plain["conv3.weight"][:, b:, 0], ours["encoder.join_pooled.weight"]
    yield plain["conv3.bias"], ours["encoder.join_point.bias"]
    for kind in ("weight", "bias"):
        for layer in range(3):
            yield plain[f"shape.{2 * layer}.{kind}"], ours[f"shape.layer{layer + 1}.{kind}"]
    first = config.pose[0]
    for k in range(config.branches):
        rows = slice(k * first, (k + 1) * first)
        for kind in ("weight", "bias"):
            yield plain[f"branches.{k}.0.{kind}"], ours[f"pose.layer1.{kind}"][rows]
        for layer in (2, 3):
            at = f"branches.{k}.{2 * layer - 2}"
            yield plain[f"{at}.weight"], ours[f"pose.weight{layer}"][k].T
            yield plain[f"{at}.bias"], ours[f"pose.bias{layer}"][k, 0]


@torch.no_grad()
def twin_of(network: ShapePoseNet) -> PlainNet:
    """A plain network with the same weights."""
    plain = PlainNet(network.config)
    theirs, ours = dict(plain.named_parameters()), dict(network.named_parameters())
    for twin, value in pairs(theirs, ours, network.config):
        twin.copy_(value)
    return plain


@torch.no_grad()
def gradients_as_ours(plain: PlainNet, network: ShapePoseNet) -> dict[str, Tensor]:
    """The plain network's gradients under `network`'s names and shapes."""
    found = {name: torch.full_like(p, torch.nan) for name, p in network.named_parameters()}
    theirs = {name: p.grad for name, p in plain.named_parameters() if p.grad is not None}
    for value, ours in pairs(theirs, found, network.config):
        ours.copy_(value)
    return found
