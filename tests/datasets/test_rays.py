# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every reader of whole frames keeps the rays that passed its objects by, and loses nothing."""

from importlib import import_module

import numpy as np
import pytest
from scipy.spatial import KDTree

from wildshape.datasets.sources import open_source
from wildshape.datasets.tracks.source import all_tracks

WRITERS = {
    "kitti-raw": "write_kitti_raw",
    "kitti-tracking": "write_kitti_tracking",
    "semantic-kitti": "write_semantic_kitti",
    "nuscenes": "write_nuscenes",
    "argoverse2": "write_argoverse2",
    "waymo": "write_waymo",
    "pandaset": "write_pandaset",
    "rgbd": "write_rgbd",
}
BOXES = {"kitti-raw", "kitti-tracking", "nuscenes", "argoverse2", "waymo", "pandaset"}


@pytest.mark.parametrize("name", WRITERS)
def test_rays_end_where_the_frame_saw_something_else(name, tmp_path):
    import_module(f"tests.datasets.{WRITERS[name]}").picture_scene(tmp_path)
    plain, seen = (
        list(all_tracks(open_source(name, tmp_path, {"min_points": 1} | asked)))
        for asked in ({}, {"rays": True})
    )
    assert [one.name for one in plain] == [one.name for one in seen]
    assert any(one.rays for one in seen)
    for one, other in zip(plain, seen):
        assert one.rays == ()
        assert (one.label_size_m is not None) == (name in BOXES)
        assert all(map(np.array_equal, one.scans, other.scans))
        for scan, rays in zip(other.scans, other.rays):
            if rays is None or not len(rays):
                continue
            assert len(rays) <= 2048
            came = rays.returned
            ends = came.starts + came.directions * came.ranges[:, None]
            assert (KDTree(scan).query(ends)[0] > 1e-5).all()
