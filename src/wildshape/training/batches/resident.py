# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The scans of a run on the device itself, and batches drawn there.

The batches have the distribution of `ViewSampler`'s. Every shape is fixed and every number comes
from counters, so that drawing is part of a step recorded once and replayed.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int64
from torch import Tensor

from wildshape.errors import BadInputError
from wildshape.geometry.centring import scan_centre
from wildshape.geometry.projection.line_of_sight import Facing, roll
from wildshape.geometry.transforms.rotation import rotation_from_uniform, rotation_z
from wildshape.ops.counter_random import integers, random_bits, uniform
from wildshape.training.batches.views import (
    Batch,
    ViewConfig,
    ViewSampler,
    centre_turns_along,
    frames_of,
)

_MOST_CENTRE_POINTS = 4096  # of a scan whose centre is found anew; steps need fixed shapes
_POINTS_AT_ONCE = 1 << 22  # decides memory alone
_LAST = 1 << 32  # above all random bits


class _Scans(NamedTuple):
    """The usable scans, track by track, as columns of one table on the device.

    Attributes:
        points: of all scans, one after the other, metres, each in its sensor's frame.
        first_point: row of each scan's first point.
        sizes: points of each scan.
        frames: turn and label-free centre of each as the network sees it before any random turn.
        reach: how many usable scans the window that begins at each scan holds.
        number: of each scan in the store.
        first_scan: row of each track's first scan.
        begins: how many scans of each track, from the first on, may begin a window.
    """

    points: Float[Tensor, "P 3"]
    first_point: Int64[Tensor, "U"]
    sizes: Int64[Tensor, "U"]
    frames: Facing
    reach: Int64[Tensor, "U"]
    number: Int64[Tensor, "U"]
    first_scan: Int64[Tensor, "T"]
    begins: Int64[Tensor, "T"]


class TooLargeError(BadInputError):
    """The scans take more memory than they may."""


class ResidentViews:
    """Draws batches on the device from scans that lie there.

    Args:
        sampler: its tracks are taken, with its rules.
        seed: of the run.
        process: number of the process; a batch depends on (seed, step, process) alone.
        device: where to.
        most_bytes: that the scans may take there; any number if None.

    Raises:
        TooLargeError: they take more.
        BadInputError: a file of the store is damaged.
    """

    def __init__(
        self,
        sampler: ViewSampler,
        seed: int,
        process: int,
        device: torch.device,
        most_bytes: int | None = None,
    ) -> None:
        self.config, self.seed, self.process = sampler.config, seed, process
        _refuse_too_large(sampler, device, most_bytes)
        self._scans = _load(sampler, device)
        self._anchors = torch.zeros(len(sampler.store.scan_sizes), 3, 3, device=device)
        largest = int(self._scans.sizes.amax())
        self._centre_points = min(largest, _MOST_CENTRE_POINTS)

    def prepare(self, step: int) -> None:
        """Nothing: the batch is drawn on the device."""

    def ahead(self) -> None:
        """Nothing, as before."""

    def close(self) -> None:
        """Nothing, for nobody draws."""

    def hold(self, anchors: Float[Tensor, "S 3 3"]) -> None:
        """From now on scans are held to these headings."""
        self._anchors.copy_(anchors)

    def batch(self, step: Int64[Tensor, ""]) -> Batch:
        """The batch of a step, a scalar on the device."""
        config, scans = self.config, self._scans
        count = config.tracks * config.views
        lanes = [config.tracks] * 2 + [config.tracks * _width(config), count]
        lanes += [config.tracks, 3 * count, count * config.points]
        bits = random_bits(self.seed, self.process, step, sum(lanes))
        track, begin, order, again, reference, turn, pick = bits.split(lanes)
        row = self._window(track, begin, order, again)
        first = torch.arange(0, count, config.views, device=step.device)
        extra = _turns(uniform(turn).view(count, 3), config)
        clouds, centres, rotation = self._clouds(row, pick.view(count, -1), extra)
        anchor = self._anchors[scans.number[row]]
        chosen = first + integers(reference, config.views)
        return Batch(clouds, centres, chosen, rotation, anchor)

    def _window(self, track: Tensor, begin: Tensor, order: Tensor, again: Tensor) -> Tensor:
        """V scans of each of I tracks, distinct where the window holds enough; `(I x V,)` rows."""
        config, scans = self.config, self._scans
        chosen = integers(track, len(scans.first_scan))
        first = (scans.first_scan[chosen] + integers(begin, scans.begins[chosen]))[:, None]
        reach = scans.reach[first]
        place = torch.arange(_width(config), device=track.device)
        order = torch.where(place < reach, order.view(config.tracks, -1), _LAST)
        distinct = order.topk(config.views, largest=False).indices
        repeated = integers(again.view(config.tracks, -1), reach)
        return (first + torch.where(reach >= config.views, distinct, repeated)).flatten()

    def _clouds(self, row: Tensor, pick: Tensor, extra: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The scans resampled, turned, about their own centres; the centres; the whole turns."""
        scans, config = self._scans, self.config
        drawn = scans.first_point[row, None] + integers(pick, scans.sizes[row, None])
        turn = extra @ scans.frames.turn[row]
        clouds = scans.points[drawn] @ turn.mT
        if centre_turns_along(config):
            centre = (extra @ scans.frames.centre[row][..., None])[..., 0]
        else:
            spread = _spread(scans.first_point[row], scans.sizes[row], self._centre_points)
            centre = scan_centre(scans.points[spread] @ turn.mT, config.sensor)
        return clouds - centre[:, None], centre, turn


def _width(config: ViewConfig) -> int:
    """Places in the table from which a window's scans are chosen."""
    return max(config.window, config.views)


def _turns(draws: Float[Tensor, "B 3"], config: ViewConfig) -> Float[Tensor, "B 3 3"]:
    """A random rotation for each scan, of the kind asked for."""
    angle = 2 * torch.pi * draws[:, 0]
    match config.turn:
        case "none":
            return torch.eye(3, device=draws.device).expand(len(draws), 3, 3)
        case "yaw":
            return rotation_z(angle)
        case "so3":
            return rotation_from_uniform(draws)
        case "facing":
            free, radius = draws[:, 1] < config.roll, (-2 * (1 - draws[:, 2]).log()).sqrt()
            return roll(torch.where(free, angle, config.roll_rad * radius * angle.cos()))


def _spread(first: Int64[Tensor, "B"], sizes: Int64[Tensor, "B"], count: int) -> Tensor:
    """`(B, count)` rows of points spread evenly over each scan; all its points if it has fewer."""
    place = torch.arange(count, device=first.device)
    return first[:, None] + place * sizes[:, None] // count


def _refuse_too_large(sampler: ViewSampler, device: torch.device, most: int | None) -> None:
    sizes = sampler.store.scan_sizes
    needed = 12 * sum(int(sizes[scans].sum()) for scans in sampler.scans_of)
    if most is not None and needed > most:
        raise TooLargeError(
            f"{sampler.store.named}: its scans take {needed / 1e9:.2f} GB, more than the"
            f" {most / 1e9:.2f} GB that they may take of the memory of {device}."
        )


def _load(sampler: ViewSampler, device: torch.device) -> _Scans:
    """Copy the usable scans to the device, a track at a time."""
    number = np.concatenate(sampler.scans_of)
    sizes = sampler.store.scan_sizes[number].astype(np.int64)
    ends = np.cumsum(sizes)
    points = torch.empty(int(ends[-1]), 3, device=device)
    at = 0
    for scans in sampler.scans_of:
        block = np.concatenate([sampler.store.scan_points(int(scan)) for scan in scans])
        points[at : at + len(block)].copy_(torch.from_numpy(block))
        at += len(block)
    first_scan = np.cumsum([0, *(len(scans) for scans in sampler.scans_of[:-1])])
    window = sampler.config.window
    begins = [np.searchsorted(s, s[-1] - window, side="right") + 1 for s in sampler.scans_of]
    reach = [np.searchsorted(s, s + window) - np.arange(len(s)) for s in sampler.scans_of]
    columns = (ends - sizes, sizes, np.concatenate(reach), number, first_scan, np.array(begins))
    first_point, held, reached, numbers, first, begin = (
        torch.from_numpy(column.astype(np.int64)).to(device) for column in columns
    )
    frames = _frames(points, first_point, sizes, sampler.config)
    return _Scans(points, first_point, held, frames, reached, numbers, first, begin)


def _frames(
    points: Float[Tensor, "P 3"], first: Int64[Tensor, "U"], sizes: np.ndarray, config: ViewConfig
) -> Facing:
    """The exact frame of every scan, many at a time."""
    rows = max(1, _POINTS_AT_ONCE // int(sizes.max()))
    found = []
    for start in range(0, len(sizes), rows):
        part = slice(start, start + rows)
        counts = torch.from_numpy(sizes[part]).to(points.device)[:, None]
        place = torch.arange(int(sizes[part].max()), device=points.device)
        scans = points[first[part, None] + place.minimum(counts - 1)]
        found.append(frames_of(scans, config, place < counts))
    return Facing(*(torch.cat(columns) for columns in zip(*found)))
