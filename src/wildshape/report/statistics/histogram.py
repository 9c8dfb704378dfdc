# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A running histogram: what millions of numbers look like, in memory that does not grow."""

import numpy as np
from jaxtyping import Float, Num

_PER_DECADE = 2400
_FEWEST_BARS = 7
_NO_DIRECTION = 1e-9  # mean of unit vectors that cancel but for rounding
LENGTHS = np.logspace(-4, 9, 13 * _PER_DECADE + 1)
"""Bins for what is positive and spans decades: points, metres, scans; 0.1 % wide."""
ANGLES = np.linspace(-180.0, 180.0, 7201)
"""Bins for degrees, a twentieth wide."""


class Tally:
    """Numbers counted in fine fixed bins, with their exact extremes and mean.

    Attributes:
        edges: `(b + 1,)` of the fine bins; what lies outside counts in the outermost.
        counts: `(b,)` numbers in each.
        count: numbers added.
        least: smallest of them; infinite while there is none.
        most: largest of them.
        whole: whether all of them are whole numbers.
        circular: whether they are degrees of a full turn: -179 is next to 179.
    """

    def __init__(self, edges: Float[np.ndarray, "b"], *, circular: bool = False) -> None:
        self.edges = edges
        self.counts = np.zeros(len(edges) - 1, np.int64)
        self.count = 0
        self.least, self.most = np.inf, -np.inf
        self.whole = True
        self.circular = circular
        self._sum = 0j

    def add(self, values: Num[np.ndarray, "n"]) -> None:
        """Count more numbers; those that are not finite are passed over."""
        values = np.asarray(values, np.float64)
        values = values[np.isfinite(values)]
        if not len(values):
            return
        bins = np.clip(np.searchsorted(self.edges, values, "right") - 1, 0, len(self.counts) - 1)
        self.counts += np.bincount(bins, minlength=len(self.counts))
        self.count += len(values)
        self.least = min(self.least, float(values.min()))
        self.most = max(self.most, float(values.max()))
        self.whole = self.whole and bool((values == np.round(values)).all())
        summed = np.exp(1j * np.radians(values)) if self.circular else values
        self._sum += complex(summed.sum())

    @property
    def mean(self) -> float:
        """Exact, of angles their mean direction; NaN of nothing, or where they have none."""
        if not self.count or (self.circular and abs(self._sum) < _NO_DIRECTION * self.count):
            return float("nan")
        if self.circular:
            return float(np.angle(self._sum, deg=True))
        return self._sum.real / self.count

    def quantile(self, share: float) -> float:
        """The number that a share of all lies below, good to the width of a fine bin."""
        if not self.count:
            return float("nan")
        at = int(np.searchsorted(np.cumsum(self.counts), share * self.count))
        at = min(at, len(self.counts) - 1)
        middle = (self.edges[at] + self.edges[at + 1]) / 2
        return float(np.clip(round(middle) if self.whole else middle, self.least, self.most))

    def spans_decades(self) -> bool:
        """Whether a logarithmic axis shows these numbers better than a linear one."""
        low, high = self.quantile(0.01), self.quantile(0.99)
        return self.edges is LENGTHS and low > 0 and high / low > 20

    def bars(self, bins: int) -> tuple[Float[np.ndarray, "edges"], Float[np.ndarray, "bars"]]:
        """Edges and heights (shares of all) of at most `bins` bars over all but the outermost 1 %.

        What lies beyond the bars counts in the first and the last. Numbers that are whole and few
        get a bar each.
        """
        edges = self._bar_edges(bins)
        middles = (self.edges[1:] + self.edges[:-1]) / 2
        inside = np.clip(middles, edges[0], edges[-1])
        heights = np.histogram(inside, edges, weights=self.counts)[0]
        return edges, heights / max(self.count, 1)

    def _bar_edges(self, bins: int) -> Float[np.ndarray, "edges"]:
        low, high = (0.0, 1.0) if not self.count else (self.quantile(0.005), self.quantile(0.995))
        if self.spans_decades():
            return np.geomspace(low * 0.97, high * 1.03, bins + 1)
        if self.whole:
            return _whole_edges(round(low), round(high), bins)
        middle, half = (low + high) / 2, (high - low) / 2 * (1 + 1 / bins)
        half = max(half, 0.15 * abs(middle), 1e-6)
        return np.linspace(middle - half, middle + half, bins + 1)


def _whole_edges(low: int, high: int, bins: int) -> Float[np.ndarray, "edges"]:
    """Between whole numbers, the same number of them in each bar, and not too few bars."""
    step = -(-(high - low + 1) // bins)
    apart = max(0, _FEWEST_BARS - (high - low + 1)) // 2
    return np.arange(low - apart, high + apart + step + 1, step) - 0.5
