# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Meshes come back closed from every format."""

import pytest
import trimesh

from wildshape.io.scans.writers import MESH_FORMATS, write_mesh


@pytest.mark.parametrize("kind", MESH_FORMATS)
def test_written_mesh_reads_back(kind, tmp_path):
    path = tmp_path / "new" / f"ball.{kind}"
    ball = trimesh.creation.icosphere(subdivisions=2)
    write_mesh(path, ball)
    found = trimesh.load_mesh(path)
    assert found.is_watertight
    assert found.volume == pytest.approx(ball.volume, rel=1e-4)
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]
