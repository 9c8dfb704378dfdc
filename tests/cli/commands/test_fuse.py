# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape fuse`: what it holds, and what a killed one left."""

import gc

from wildshape.inference import registration
from wildshape.records import Completion


def test_shapes_are_not_held_until_the_end(wildshape, dataset, trained, tmp_path, monkeypatch):
    """Of thousands of scans they would take a hundred kilobytes each."""
    held: list[int] = []

    def counting(*arguments):
        gc.collect()
        done = [one for one in gc.get_objects() if type(one) is Completion]
        held.append(sum(len(one.points) for one in done))
        assert len(done) >= len(arguments[0])
        return fuse(*arguments)

    fuse = registration.fuse_scans
    monkeypatch.setattr(registration, "fuse_scans", counting)
    track = next(dataset.glob("*/scans")).parent
    command = ("fuse", track, "--out", tmp_path / "fused.ply", "--model", trained)
    assert wildshape(*command).code == 0
    assert held == [0]


def test_what_a_killed_one_left_goes_with_the_next(wildshape, dataset, trained, tmp_path):
    left = tmp_path / ".fused.ply.x1y2.part"
    left.write_bytes(b"half")
    track = next(dataset.glob("*/scans")).parent
    command = ("fuse", track, "--out", tmp_path / "fused.ply", "--model", trained)
    assert wildshape(*command).code == 0
    assert [file.name for file in tmp_path.iterdir()] == ["fused.ply"]
