# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every reader of whole frames keeps the rays that passed its objects by, and loses nothing."""

from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from experiments.dataset_pictures import WRITERS
from scipy.spatial import KDTree

from wildshape.datasets.sources import SOURCES, open_source
from wildshape.datasets.tracks.source import all_tracks

READERS = {name: open_source(name, Path(), {}) for name in SOURCES}


@pytest.mark.parametrize("name", [name for name, one in READERS.items() if hasattr(one, "rays")])
def test_rays_end_where_the_frame_saw_something_else(name, tmp_path):
    resolve_name(WRITERS[name])(tmp_path)
    plain, seen = (
        list(all_tracks(open_source(name, tmp_path, {"min_points": 1} | asked)))
        for asked in ({}, {"rays": True})
    )
    assert [one.name for one in plain] == [one.name for one in seen]
    assert any(one.rays for one in seen)
    for one, other in zip(plain, seen):
        assert one.rays == ()
        assert (one.label_size_m is not None) == hasattr(READERS[name], "crop")
        assert all(map(np.array_equal, one.scans, other.scans))
        for scan, rays in zip(other.scans, other.rays):
            if rays is None or not len(rays):
                continue
            assert len(rays) <= 2048
            came = rays.returned
            ends = came.starts + came.directions * came.ranges[:, None]
            assert (KDTree(scan).query(ends)[0] > 1e-5).all()
            assert _aside(ends, scan).max() < 1.5 * (_aside(scan, scan).max() + _margin(scan))


def _aside(points, scan):
    """Angles between points and the middle of a scan, as its sensor sees them."""
    middle = (scan / np.linalg.norm(scan, axis=1, keepdims=True)).mean(axis=0)
    along = points @ (middle / np.linalg.norm(middle)) / np.linalg.norm(points, axis=1)
    return np.arccos(np.clip(along, -1, 1))


def _margin(scan):
    """Rays that pass an object by are kept within 1 m of its nearest point; radians."""
    return 1 / max(np.linalg.norm(scan, axis=1).min(), 1)
