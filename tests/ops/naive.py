# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Slow twins of the operations: loops over float64 numbers, nothing else."""

import math

import numpy as np
import torch
from torch import Tensor


def nearest(query: Tensor, target: Tensor, query_sizes=None, target_sizes=None):
    """Squared distances (float64) and indices, a pair at a time."""
    (B, N), M = query.shape[:2], target.shape[1]
    squared, index = np.zeros((B, N)), np.zeros((B, N), dtype=np.int64)
    for b in range(B):
        rows = N if query_sizes is None else int(query_sizes[b])
        columns = M if target_sizes is None else int(target_sizes[b])
        for i in range(rows):
            squared[b, i] = math.inf
            for j in range(columns):
                d2 = float(((query[b, i].double() - target[b, j].double()) ** 2).sum())
                if d2 < squared[b, i]:
                    squared[b, i], index[b, i] = d2, j
    return torch.from_numpy(squared), torch.from_numpy(index)


def distance_gradient(query: Tensor, target: Tensor, index: Tensor, weight: Tensor):
    """Gradient of `sum(weight * |query - target[index]|)` to both clouds, in float64."""
    to_query = torch.zeros(query.shape, dtype=torch.float64)
    to_target = torch.zeros(target.shape, dtype=torch.float64)
    for b in range(query.shape[0]):
        for i in range(query.shape[1]):
            apart = query[b, i].double() - target[b, index[b, i]].double()
            length = float(apart.norm())
            if length > 0:
                pull = float(weight[b, i]) * apart / length
                to_query[b, i] += pull
                to_target[b, index[b, i]] -= pull
    return to_query, to_target


def visible(bins: Tensor, depth: Tensor, n_bins: int) -> Tensor:
    """Smallest (depth, index) of each bin, through a dictionary."""
    seen = torch.zeros(bins.shape, dtype=torch.bool)
    for b in range(len(bins)):
        front: dict[int, tuple[float, int]] = {}
        for i, (bin_, d) in enumerate(zip(bins[b].tolist(), depth[b].tolist())):
            if 0 <= bin_ < n_bins:
                far = math.inf if math.isnan(d) else d
                front[bin_] = min(front.get(bin_, (math.inf, len(bins[b]))), (far, i))
        for _, i in front.values():
            seen[b, i] = True
    return seen
