# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A mesh is blue where it was measured and turns orange where it was guessed."""

import io
from typing import Any

import numpy as np
import pytest
import trimesh

from wildshape.errors import BadInputError
from wildshape.geometry.meshing import colour_by_confidence, place_confidence
from wildshape.io.scans.writers import MESH_FORMATS, write_mesh

CENTRE = np.array([40.0, -25.0, -1.0])


def ball(radius: float = 1.0) -> Any:
    made = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    made.apply_translation(CENTRE)
    return made


def front(mesh):
    """The half that a sensor at the origin sees."""
    return mesh.vertices[(mesh.vertices - CENTRE) @ CENTRE < 0].astype(np.float32)


def test_confidence_falls_with_the_distance_to_what_was_measured():
    scan = np.array([[30.0, 5, -1]] * 3, np.float32)
    places = scan[:1] + np.array([[0, 0, 0], [0, 0.25, 0], [0.5, 0, 0], [0, 0, 3]])
    found = place_confidence(places, scan, confidence=0.8)
    np.testing.assert_allclose(found, [1, 1 - 0.48 / 2, 0.52, 0.52], atol=1e-5)


def test_points_that_are_none_measured_nothing():
    """One NaN, as sensors leave where nothing came back, made all of a mesh a guess."""
    scan = np.array([[30.0, 5, -1], [31, 5, -1], [np.nan] * 3, [np.inf, 0, 0]], np.float32)
    places = scan[:1] + np.array([[0, 0, 0], [0, 0.25, 0]])
    expected = place_confidence(places, scan[:2], confidence=0.8)
    np.testing.assert_array_equal(place_confidence(places, scan, confidence=0.8), expected)
    for none in (scan[2:], scan[:0]):
        with pytest.raises(BadInputError, match="no finite point"):
            place_confidence(places, none, confidence=0.8)


@pytest.mark.parametrize("wrong", [np.ones((20, 4)), np.ones(20), "scan.ply", [[1.0, 2.0], [3.0]]])
def test_what_is_no_scan_is_refused(wrong):
    with pytest.raises(BadInputError, match=r"scan: .*\(n, 3\)"):
        place_confidence(np.ones((5, 3)), wrong, confidence=0.8)


@pytest.mark.parametrize("radius", [1.0, 0.05])
def test_the_half_not_seen_is_less_sure(radius):
    """Also of a small object, of which nothing is half a metre from anything."""
    mesh = ball(radius)
    colour_by_confidence(mesh, front(mesh), 0.9)
    held = mesh.vertex_attributes["confidence"]
    seen = (mesh.vertices - CENTRE) @ CENTRE < 0
    assert held[seen].min() > 0.999
    assert held[~seen].mean() < 0.75
    red, _, blue, _ = np.asarray(mesh.visual.vertex_colors).T.astype(int)
    assert (blue - red)[seen].min() > 150
    assert (blue - red)[~seen].min() < 60


@pytest.mark.parametrize("kind", MESH_FORMATS)
def test_colours_are_in_the_file(kind, tmp_path):
    mesh = ball()
    colour_by_confidence(mesh, front(mesh), 0.9)
    write_mesh(tmp_path / f"a.{kind}", mesh)
    found: Any = trimesh.load_mesh(tmp_path / f"a.{kind}")
    colours = np.asarray(found.visual.vertex_colors).astype(int)
    assert np.ptp(colours[:, 2] - colours[:, 0]) > 100


def test_the_attribute_is_in_ply():
    mesh = ball()
    colour_by_confidence(mesh, front(mesh), 0.9)
    made = mesh.export(file_type="ply")
    assert isinstance(made, bytes)
    header = io.BytesIO(made).read(600)
    assert b"property float confidence" in header
