# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes are held to labels where there are some."""

from dataclasses import replace

import pytest
from experiments.labelled_boxes import labelled

from wildshape.errors import BadInputError
from wildshape.io.write_tracks import write_tracks


def written(path, tracks):
    write_tracks(tracks, path, "packed", command="test", settings={})
    return path


def test_only_tracks_whose_boxes_are_known_are_measured(cars, tmp_path):
    known, unposed = cars[0], replace(cars[1], T_sensor_object=None)
    bare = replace(cars[2], shape=None)
    assert [one.name for one in labelled(written(tmp_path / "some", (unposed, known, bare)))] == [
        known.name
    ]
    none = written(tmp_path / "none", (unposed, bare))
    with pytest.raises(BadInputError, match="none: no track has true poses"):
        labelled(none)
