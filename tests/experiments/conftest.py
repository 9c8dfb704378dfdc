# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A folder of meshes to train on, and what a stopped run leaves."""

from contextlib import suppress

import pytest
import trimesh

from wildshape.io.store.writer import StoreWriter


@pytest.fixture
def half_written():
    """Leaves at a path what is there of a store after a stop."""

    def leave(path):
        with suppress(KeyboardInterrupt), StoreWriter(path, {}):
            raise KeyboardInterrupt

    return leave


@pytest.fixture(scope="session")
def cad(tmp_path_factory):
    """A car and a bus to train on, and a car of the test split."""
    folder = tmp_path_factory.mktemp("cad")
    rows = ["category,file,split,tier,licence,source,name"]
    for category, name, split, tier, licence, size in (
        ("car", "red", "train", "A", "CC-BY-3.0", (4.5, 2.9, 3.1)),
        ("bus", "big", "train", "A?", "CC0-1.0", (9.0, 5.0, 2.0)),
        ("car", "gnu", "train", "B", "GPL-2.0", (4.0, 1.8, 1.5)),
        ("car", "blue", "test", "C", "none stated", (4.0, 1.8, 1.5)),
    ):
        trimesh.creation.box(size).export(folder / f"{name}.ply")
        rows.append(f"{category},{name}.ply,{split},{tier},{licence},gazebo_models,{name}")
    (folder / "manifest.csv").write_text("\n".join(rows), encoding="utf-8")
    return folder
