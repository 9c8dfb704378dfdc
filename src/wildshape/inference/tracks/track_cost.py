# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The label-free cost of one shape in every scan of a track."""

from collections.abc import Iterator

import torch
from jaxtyping import Float
from torch import Tensor

from wildshape.geometry.transforms.se3 import SE3
from wildshape.method.checkpoint import ModelSettings
from wildshape.method.choose_hypothesis import NetworkInput, network_input
from wildshape.method.hindsight import score_hypotheses
from wildshape.records import Points

_BATCH = 32


def network_inputs(scans: list[Points], settings: ModelSettings) -> list[NetworkInput]:
    """What a network sees of a track's scans, some at a time."""
    parts = (scans[start : start + _BATCH] for start in range(0, len(scans), _BATCH))
    of = settings
    return [network_input(part, of.input_points, of.sensor, of.facing) for part in parts]


def track_cost(
    shape: Float[Tensor, "P 3"],
    T_sensor_object: SE3,
    inputs: list[NetworkInput],
    settings: ModelSettings,
) -> Float[Tensor, "V"]:
    """The label-free cost of one shape in every scan, metres (METHOD 6)."""
    return torch.cat(list(_costs(shape, T_sensor_object, inputs, settings))).double()


def _costs(
    shape: Float[Tensor, "P 3"],
    T_sensor_object: SE3,
    inputs: list[NetworkInput],
    settings: ModelSettings,
) -> Iterator[Tensor]:
    start = 0
    for seen in inputs:
        count = len(seen.scans)
        posed = T_sensor_object[start : start + count].apply(shape.expand(count, -1, -1)).float()
        posed = posed @ seen.turn.mT - seen.centres[:, None]
        scores = score_hypotheses(
            seen.scans, seen.centres, posed[:, None], settings.projection, seen.sizes
        )
        yield scores.cost(settings.beta)[:, 0]
        start += count
