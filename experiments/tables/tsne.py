# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""t-SNE (van der Maaten and Hinton 2008), exact: for the few hundred codes of a figure."""

import numpy as np
from jaxtyping import Float

_STEPS, _EXAGGERATED, _EXAGGERATION = 750, 150, 12.0
_SMALLEST = 1e-12


def tsne(codes: Float[np.ndarray, "n z"], perplexity: float = 20.0) -> Float[np.ndarray, "n 2"]:
    """Places in a plane that keep neighbours together; the same every time.

    Args:
        codes: at least 4.
        perplexity: how many neighbours count; lowered to a quarter of the codes.
    """
    near = _joint(_squared_distances(codes), min(perplexity, len(codes) / 4))
    places = np.random.default_rng(0).normal(0, 1e-2, (len(codes), 2))
    speed, gain = np.zeros_like(places), np.ones_like(places)
    rate = max(len(codes) / _EXAGGERATION, 10.0)
    for step in range(_STEPS):
        early = step < _EXAGGERATED
        gradient = _gradient(near * (_EXAGGERATION if early else 1.0), places)
        agreed = (gradient > 0) == (speed > 0)
        gain = np.maximum(np.where(agreed, 0.8 * gain, gain + 0.2), 0.01)
        speed = (0.5 if early else 0.8) * speed - rate * gain * gradient
        places = places + speed
        places -= places.mean(0)
    return places


def _squared_distances(points: np.ndarray) -> np.ndarray:
    lengths = (points**2).sum(1)
    found = lengths[:, None] + lengths[None] - 2 * points @ points.T
    np.fill_diagonal(found, 0.0)
    return np.maximum(found, 0.0)


def _joint(squared: np.ndarray, perplexity: float) -> np.ndarray:
    """Symmetric neighbour probabilities, each row's width found by bisection."""
    rows = np.stack([_row(distances, i, perplexity) for i, distances in enumerate(squared)])
    joint = rows + rows.T
    return np.maximum(joint / joint.sum(), _SMALLEST)


def _row(squared: np.ndarray, own: int, perplexity: float) -> np.ndarray:
    others = np.arange(len(squared)) != own
    distances = squared[others] / max(squared[others].mean(), _SMALLEST)
    low, high = 1e-6, 1e6
    found = np.ones_like(distances) / len(distances)
    for _ in range(60):
        precision = np.sqrt(low * high)
        weights = np.exp(-precision * (distances - distances.min()))
        found = weights / weights.sum()
        entropy = -(found * np.log(np.maximum(found, _SMALLEST))).sum()
        low, high = (precision, high) if entropy > np.log(perplexity) else (low, precision)
    whole = np.zeros(len(squared))
    whole[others] = found
    return whole


def _gradient(near: np.ndarray, places: np.ndarray) -> np.ndarray:
    heavy = 1.0 / (1.0 + _squared_distances(places))
    np.fill_diagonal(heavy, 0.0)
    pull = (near - np.maximum(heavy / heavy.sum(), _SMALLEST)) * heavy
    return 4 * (pull.sum(1)[:, None] * places - pull @ places)
