# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Rays and labelled sizes through track folders and packed stores."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.io.store.stores import make_parts
from tests.packed import packed
from tests.refusal import refused

from wildshape.inference.point_inputs import together
from wildshape.io.inputs import open_tracks, with_rays
from wildshape.io.rays import read_rays, write_rays
from wildshape.io.scans.points import SENSOR_METRES, Coordinates
from wildshape.io.store.join import join_stores
from wildshape.io.store.layout import PARTS, WRITING_JSON
from wildshape.io.store.store import open_store
from wildshape.io.tracks import read_track, write_track
from wildshape.records import SightLines, Track

SIZE = (4.1, 1.7, 1.5)


def rays_of(count: int, *, merged: bool = False) -> SightLines:
    rng = np.random.default_rng(count)
    rays = SightLines.of_returns(
        rng.uniform(1, 5, (count, 3)), rng.random((count, 3)) if merged else None
    )
    rays.ranges[::3] = np.inf
    return rays


@pytest.fixture
def seen(track: Track) -> Track:
    """Three scans: with rays, without, and with those of several sensors."""
    return replace(track, rays=(rays_of(7), None, rays_of(4, merged=True)), label_size_m=SIZE)


def assert_same_rays(found: Track, truth: Track) -> None:
    assert (found.label_size_m, found.shape_kind) == (truth.label_size_m, truth.shape_kind)
    assert len(found.rays) == len(truth.rays)
    for one, other in zip(found.rays, truth.rays):
        assert (one is None) == (other is None)
        if one is not None and other is not None:
            assert np.array_equal(one.directions, other.directions)
            assert np.array_equal(one.ranges, other.ranges)
            assert (one.origins is None) == (other.origins is None)
            assert np.array_equal(one.starts, other.starts)


def test_shape_kind_is_kept_or_refused(seen: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", replace(seen, shape_kind="partial"))
    assert read_track(tmp_path / "t").shape_kind == "partial"
    info = tmp_path / "t" / "track.json"
    info.write_text(info.read_text().replace('"partial"', '"half"'))
    refused(read_track, tmp_path / "t", match="shape_kind 'half' is unknown; use one of whole")


def test_folders_keep_rays(seen: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", seen)
    assert_same_rays(read_track(tmp_path / "t"), seen)
    alone = open_tracks(tmp_path / "t" / "scans" / "000012.ply")[0]
    assert_same_rays(replace(seen.part([2]), label_size_m=None), alone)
    (tmp_path / "t" / "scans" / "000010.ply").write_bytes(b"ply\nbroken")
    assert_same_rays(read_track(tmp_path / "t"), seen.part([1, 2]))


def test_stores_keep_rays_however_they_are_joined(seen: Track, tmp_path: Path) -> None:
    (tmp_path / "out" / PARTS).mkdir(parents=True)
    (tmp_path / "out" / WRITING_JSON).write_text("{}")
    parts = [tmp_path / "out" / PARTS / name for name in "ab"]
    bare = replace(seen, rays=(), label_size_m=None, shape_kind="partial")
    seen = replace(seen, shape_kind="mirrored")
    for path, order in zip(parts, ((bare, seen), (seen, bare, seen))):
        packed(
            path, [replace(one, name=f"{path.name}{number}") for number, one in enumerate(order)]
        )
    join_stores(parts, tmp_path / "out", {})
    found = list(open_store(tmp_path / "out"))
    for one, truth in zip(found, (bare, seen, seen, bare, seen), strict=True):
        assert_same_rays(one, truth)


def test_a_store_without_rays_is_what_it_was(track: Track, tmp_path: Path) -> None:
    """Not a byte more: fingerprints of the data that weights were trained on stay."""
    (path, _) = make_parts(track, tmp_path)
    names = (path / "index.safetensors").read_bytes()[:4000]
    assert b"ray_" not in names
    assert b"label_" not in names
    assert b"_shapes" not in names
    assert open_store(path).track(0).rays == ()


def test_rays_that_were_changed_are_refused(seen: Track, tmp_path: Path) -> None:
    store = packed(tmp_path / "s", [seen])
    shard = tmp_path / "s" / "points-00000.safetensors"
    damaged = bytearray(shard.read_bytes())
    damaged[256 + 5] ^= 1  # rays come before the first scan
    shard.write_bytes(damaged)
    refused(store.track, 0, match="rays of scan 0 of the store are not those")


@pytest.mark.parametrize("times", [0.001, 0.01, 100, 1000])
def test_rays_of_another_unit_than_the_scans_are_refused(
    track: Track, tmp_path: Path, times: float
) -> None:
    """Nothing noticed; all of the object was taken for free space, or for hidden."""
    scan = track.scans[0] + np.array((10, 2, 0), np.float32)
    beside = scan[:, None] * np.linspace(0.8, 3.0, 4, dtype=np.float32)[None, :, None]
    rays = SightLines.of_returns(beside.reshape(-1, 3))
    write_track(tmp_path / "t", replace(track.part([0]), scans=(scan,), rays=(rays,)))
    assert len(read_track(tmp_path / "t").rays) == 1
    file = next((tmp_path / "t" / "rays").iterdir())
    wrong = SightLines(rays.directions, rays.ranges * times)
    write_rays(file, wrong)
    match = "as far away as their object lies; give their ranges and origins in the unit"
    refused(read_track, tmp_path / "t", match=f"{file.name}: .*{match}")
    alone = next((tmp_path / "t" / "scans").iterdir())
    refused(lambda path: list(open_tracks(path)), alone, match=match)
    refused(together, [scan], [wrong], None, match=f"rays 0: .*{match}")
    file.rename(tmp_path / "r.npz")
    source = open_tracks(alone)
    refused(with_rays, source, tmp_path / "r.npz", SENSOR_METRES, match=f"r.npz: .*{match}")


def test_rays_of_another_scan_or_frame_are_refused(track: Track, tmp_path: Path) -> None:
    """Nothing noticed; no ray said anything of the object."""
    scan = track.scans[0] + np.array((10, 2, 0), np.float32)
    beside = SightLines.of_returns(scan * np.array((1.5, 1.6, 1.5), np.float32))
    write_track(tmp_path / "t", replace(track.part([0]), scans=(scan,), rays=(beside,)))
    assert len(read_track(tmp_path / "t").rays) == 1
    (file,) = (tmp_path / "t" / "rays").iterdir()
    match = f"{file.name}: no ray comes nearer than .* the same scan"
    for elsewhere in (beside.directions[:, [1, 0, 2]], -beside.directions):
        write_rays(file, SightLines(elsewhere, beside.ranges))
        refused(read_track, tmp_path / "t", match=match)


def test_units_and_refusals_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "r.npz"
    write_rays(path, rays_of(4, merged=True))
    metres, moved = read_rays(path), read_rays(path, Coordinates("mm", (1.0, 0.0, 0.0)))
    assert np.allclose(moved.ranges, metres.ranges / 1000)
    assert np.allclose(moved.starts, (metres.starts - (1, 0, 0)) / 1000)
    np.savez(path, directions=np.eye(3))
    refused(read_rays, path, match="r.npz: lacks ranges")
    np.savez(path, directions=np.eye(3), ranges=np.ones(2))
    refused(read_rays, path, match="r.npz: rays: directions .3, 3. do not fit")
    path.write_bytes(path.read_bytes()[:100])
    refused(read_rays, path, match="r.npz: expected a numpy archive of rays")
    refused(read_rays, tmp_path / "none.npz", match="no such file")
