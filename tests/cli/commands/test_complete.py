# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`complete --rays`: the rays of one scan reach the result, or are refused."""

import json

import pytest

import wildshape as library
from wildshape.io.rays import read_rays


@pytest.fixture
def hidden(wildshape, tmp_path):
    """A track of two scans, something in front of the car, with rays."""
    asked = ("--tracks", 1, "--scans", 2, "--seed", 4, "--occlusion", 0.999, "--rays")
    done = wildshape("simulate", tmp_path / "data", *asked, "--layout", "folders", "--workers", 1)
    assert done.code == 0, done.err
    return next((tmp_path / "data").glob("*/track.json")).parent


def test_the_rays_of_a_file_are_those_of_the_library(wildshape, refused, hidden, tmp_path):
    scan, rays = (next(iter(sorted(hidden.glob(kind)))) for kind in ("scans/*", "rays/*.npz"))
    alone = library.load().complete(scan)
    under = library.load().complete(scan, rays=read_rays(rays))
    assert abs(under.box.size[0] - alone.box.size[0]) > 0.1
    done = wildshape("complete", scan, "--rays", rays, "--out", tmp_path / "out")
    assert done.code == 0, done.err
    (record,) = json.loads(next((tmp_path / "out").rglob("objects.json")).read_text())["scans"]
    assert record["cost_m"] == pytest.approx(under.cost, abs=1e-3)
    assert record["p_pose"] == pytest.approx(under.p_pose, abs=1e-2)
    said = refused("complete", hidden, "--rays", rays, "--out", tmp_path / "all")
    assert "holds 2; keep those of a track in its folder rays/" in said
