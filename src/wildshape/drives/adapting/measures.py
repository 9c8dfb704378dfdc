# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What tells without labels which of two models suits tracks better that neither was trained on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wildshape.drives.adapting.config import AdaptConfig
from wildshape.drives.adapting.examples import Example
from wildshape.inference.predictor import Predictor


@dataclass(frozen=True)
class Measures:
    """Of a model on tracks held out; means over tracks.

    Attributes:
        cost_m: label-free cost of the shape that a whole track gives, in its middle scan by cost.
        spread_m: standard deviation along a track of length, width and height of the boxes that
            its scans give one by one.
        headings: share of the scans that, completed one by one, look as the first pass's track.
    """

    cost_m: float
    spread_m: tuple[float, float, float]
    headings: float

    @property
    def mean_spread_m(self) -> float:
        """Over the three sides of the box."""
        return float(np.mean(self.spread_m))

    def worse_than(self, other: "Measures") -> tuple[str, ...]:
        """In what these are worse, in words."""
        compared = {
            "its shapes cost more": self.cost_m > other.cost_m,
            "its sizes agree less along tracks": self.mean_spread_m > other.mean_spread_m,
            "it turns more scans around": self.headings < other.headings,
        }
        return tuple(said for said, worse in compared.items() if worse)


def measure(
    predictor: Predictor,
    examples: Sequence[Example],
    config: AdaptConfig,
    at: Callable[[int], None],
) -> Measures:
    """The measures of a model."""
    rows = []
    for done, example in enumerate(examples, 1):
        some = example.some(config.measured)
        alone = list(predictor.complete_many(some.scans))
        cost = np.median([one.cost for one in predictor.complete_track(some.scans)])
        spread = np.std([one.box.size for one in alone], axis=0, ddof=1)
        rows.append((cost, *spread, some.share_alike(alone)))
        at(done)
    cost, length, width, height, headings = np.mean(rows, axis=0).tolist()
    return Measures(cost, (length, width, height), headings)


def clear_headed(
    predictor: Predictor,
    examples: Sequence[Example],
    config: AdaptConfig,
    at: Callable[[int], None],
) -> list[Example]:
    """Those of which it is sure which way they look: they drive there, or most scans say so."""
    raw = Predictor(predictor.network, predictor.settings, raw=True, config=predictor.config)
    kept = []
    for done, example in enumerate(examples, 1):
        some = example.some(config.measured)
        if example.moving or some.share_alike(list(raw.complete_many(some.scans))) >= config.clear:
            kept.append(example)
        at(done)
    return kept
