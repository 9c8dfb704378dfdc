# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The first hit is the nearest of all triangles, by the textbook formula."""

import sys

import numpy as np
import pytest

from wildshape.errors import MissingExtraError
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import Solid, box
from wildshape.simulate.shapes.vehicle import vehicle


def _brute(solid: Solid, origin: np.ndarray, direction: np.ndarray) -> float:
    """Nearest distance along one ray over all triangles (Moeller-Trumbore)."""
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, p)
    ok = np.abs(det) > 1e-14
    inv = 1 / np.where(ok, det, 1.0)
    s = origin - a
    u = np.einsum("ij,ij->i", s, p) * inv
    q = np.cross(s, e1)
    v = (q @ direction) * inv
    t = np.einsum("ij,ij->i", e2, q) * inv
    hit = ok & (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    return float(t[hit].min()) if hit.any() else np.inf


def test_first_hit_is_the_nearest() -> None:
    rng = np.random.default_rng(0)
    solid = vehicle("pickup", rng).centred()
    origins = rng.normal((9.0, 3.0, 1.0), 1, (300, 3))
    at = rng.uniform(solid.bounds[0], solid.bounds[1], (300, 3))
    toward = at - origins
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    found = Scene([solid]).cast(origins, toward).distance
    truth = np.array([_brute(solid, o, d) for o, d in zip(origins, toward)])
    agree = np.isclose(found, truth, atol=1e-3) | (np.isinf(found) & np.isinf(truth))
    assert agree.mean() > 0.99  # a ray along a silhouette edge may fall on either side in float32
    assert np.isfinite(truth).sum() > 150


def test_solids_are_told_apart_and_misses_are_infinite() -> None:
    near, far = box((1.0, -1.0, -1.0), (2.0, 1.0, 1.0)), box((3.0, -9.0, -1.0), (4.0, 9.0, 1.0))
    directions = np.array(((1.0, 0, 0), (0.6, 0.8, 0), (-1.0, 0, 0)))
    hits = Scene([near, far]).cast(np.zeros((3, 3)), directions)
    assert hits.solid.tolist() == [0, 1, -1]
    np.testing.assert_allclose(hits.distance, [1.0, 5.0, np.inf])
    np.testing.assert_allclose(hits.cosine, [1.0, 0.6, 0.0], atol=1e-6)


def test_without_embreex_one_sentence_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "embreex", None)
    with pytest.raises(MissingExtraError, match="pip install embreex"):
        Scene([])
