# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.cars import shape_of
from tests.packed import packed
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.io.fingerprint import fingerprint_of
from wildshape.io.inputs import open_tracks
from wildshape.io.rays import write_rays
from wildshape.io.scans.points import Coordinates, read_points
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import NoUsableScanError, write_track
from wildshape.records import SightLines, Track


@pytest.fixture
def dataset(track: Track, tmp_path: Path) -> Path:
    for name in ("b", "a"):
        write_track(tmp_path / "data" / name, replace(track, name=name))
    (tmp_path / "data" / "notes").mkdir()
    (tmp_path / "data" / "README.txt").write_text("words")
    return tmp_path / "data"


def test_dataset(dataset: Path) -> None:
    source = open_tracks(dataset)
    assert source.names == ("a", "b")
    assert len(source) == 2
    assert [t.name for t in source] == ["a", "b"]
    assert source[-1].name == "b"
    assert source.skipped == ()
    with pytest.raises(IndexError):
        source[2]


def test_track_folder_plain_folder_and_one_scan(dataset: Path) -> None:
    (track,) = open_tracks(dataset / "a")
    assert (track.name, len(track.scans), track.category) == ("a", 3, "car")
    (track,) = open_tracks(dataset / "a" / "scans")
    assert (track.name, len(track.scans), track.category) == ("scans", 3, "")
    (track,) = open_tracks(dataset / "a" / "scans" / "000011.ply")
    assert (track.name, track.scan_names, len(track.scans[0])) == ("000011", ("000011",), 20)


def test_a_packed_store_gives_each_place_once_as_a_folder_does(
    track: Track, tmp_path: Path
) -> None:
    twice = replace(track, scans=tuple(np.concatenate((scan, scan)) for scan in track.scans))
    packed(tmp_path / "store", [twice])
    write_track(tmp_path / "folder", twice)
    for path in (tmp_path / "store", tmp_path / "folder"):
        (found,) = open_tracks(path)
        for scan, once in zip(found.scans, track.scans, strict=True):
            np.testing.assert_array_equal(scan, once)


def test_what_is_done_to_a_track_of_a_store_changes_none_that_is_read_later(
    track: Track, tmp_path: Path
) -> None:
    packed(tmp_path / "store", [track])
    source = open_tracks(tmp_path / "store")
    found = source[0]
    for points in (*found.scans, shape_of(found)):
        points[:] = 0.0
    for again in (source[0], open_tracks(tmp_path / "store")[0]):
        np.testing.assert_array_equal(again.scans[0], track.scans[0])
        np.testing.assert_array_equal(again.shape, track.shape)


def test_packed_store(track: Track, tmp_path: Path) -> None:
    packed(tmp_path / "store", [track])
    source = open_tracks(tmp_path / "store")
    assert source.names == ("car-1",)
    np.testing.assert_array_equal(source[0].scans[2], track.scans[2])


def test_tracks_are_read_when_asked_for(dataset: Path) -> None:
    source = open_tracks(dataset)
    for path in (dataset / "b" / "scans").iterdir():
        path.write_text("ply, but broken later")
    assert source[0].name == "a"
    with pytest.raises(NoUsableScanError):
        source[1]


def test_bad_scans_are_counted_and_listed_once(dataset: Path) -> None:
    (dataset / "a" / "scans" / "000011.ply").write_text("no")
    for path in (dataset / "b" / "scans").iterdir():
        path.write_text("no")
    source = open_tracks(dataset)
    for _ in range(2):
        assert [len(track.scans) for track in source] == [2]
    names = [name for name, _ in source.skipped]
    assert names == ["a/000011.ply", "b/000010.ply", "b/000011.ply", "b/000012.ply", "b"]


def test_a_scan_whose_link_leads_nowhere_is_skipped_and_told(dataset: Path) -> None:
    away, scan = dataset / "on a disk that is away.ply", dataset / "a" / "scans" / "000011.ply"
    scan.rename(away)
    scan.symlink_to(away)
    there = fingerprint_of(dataset)
    away.rename(away.with_suffix(""))
    source = open_tracks(dataset)
    assert [len(track.scans) for track in source] == [2, 3]
    ((name, why),) = source.skipped
    assert (name, why.endswith("no such file; check the path.")) == ("a/000011.ply", True)
    assert fingerprint_of(dataset) != there


def test_dropped_points_are_listed(tmp_path: Path, cloud: np.ndarray) -> None:
    dirty = cloud.copy()
    dirty[0] = np.inf
    write_ply(tmp_path / "a.ply", dirty)
    source = open_tracks(tmp_path / "a.ply")
    assert len(source[0].scans[0]) == 59
    assert source.dropped_nonfinite == (("a/a.ply", 1),)


@pytest.mark.parametrize("names", [("9", "10"), ("scan-8", "scan-9", "scan-10")])
def test_numbers_without_leading_zeros_are_doubted(
    tmp_path: Path, cloud: np.ndarray, names: tuple[str, ...]
) -> None:
    for track in ("a", "b"):
        for name in names:
            write_ply(tmp_path / track / "scans" / f"{name}.ply", cloud)
    source = open_tracks(tmp_path)
    assert source.doubts == ()
    assert len(list(source)) == 2
    (told,) = source.doubts
    assert told.startswith(f"a: {names[-1]}.ply is sorted before {names[0]}.ply")
    assert "1 more track likewise" in told


def test_a_scan_in_two_formats_is_told(dataset: Path) -> None:
    scans = dataset / "a" / "scans"
    (dataset / "a" / "poses.txt").unlink()
    first = min(scans.iterdir())
    np.savetxt(scans / f"{first.stem}.xyz", read_points(first))
    source = open_tracks(dataset)
    assert len(next(iter(source)).scans) == len(list(scans.iterdir()))
    (told,) = source.doubts
    assert told.startswith(f"a: {first.name} and {first.stem}.xyz are taken for two scans;")


def test_each_kind_of_odd_names_is_told_with_its_own_tracks(
    tmp_path: Path, cloud: np.ndarray
) -> None:
    rays = SightLines(np.eye(3, dtype=np.float32), np.full(3, np.inf, np.float32))
    for track, names in {"a": ("10", "9"), "b": ("1", "2"), "c": ("1", "2")}.items():
        for name in names:
            write_ply(tmp_path / track / "scans" / f"{name}.ply", cloud)
        (tmp_path / track / "rays").mkdir()
        write_rays(tmp_path / track / "rays" / "other.npz", rays)
    source = open_tracks(tmp_path)
    assert len(list(source)) == 3
    order, unused = source.doubts
    assert order.startswith("a: 10.ply is sorted before 9.ply")
    assert "likewise" not in order
    assert unused.startswith("a: rays/other.npz and all others there are not used")
    assert unused.endswith("(2 more tracks likewise)")


def test_names_that_do_not_count_are_not_doubted(tmp_path: Path, cloud: np.ndarray) -> None:
    for name in ("2011-10-9", "2011-9-10", "car", "10"):
        write_ply(tmp_path / f"{name}.ply", cloud)
    source = open_tracks(tmp_path)
    assert len(source[0].scans) == 4
    assert source.doubts == ()


def test_a_run_without_any_usable_scan_fails(tmp_path: Path) -> None:
    write_ply(tmp_path / "d" / "t" / "scans" / "0.ply", np.zeros((40, 3), np.float32))
    with pytest.raises(BadInputError, match="all 40 points are equal"):
        list(open_tracks(tmp_path / "d"))


def test_one_bad_scan_file_raises(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", np.zeros((2, 3), np.float32))
    with pytest.raises(BadInputError, match=r"a\.ply: 2 finite points"):
        list(open_tracks(tmp_path / "a.ply"))


def test_truth_beside_scans_is_no_scan(tmp_path: Path, cloud: np.ndarray) -> None:
    write_ply(tmp_path / "0.ply", cloud)
    write_ply(tmp_path / "shape.ply", cloud)
    (tmp_path / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    (track,) = open_tracks(tmp_path)
    assert track.scan_names == ("0",)


def test_nothing_recognisable(tmp_path: Path) -> None:
    refused(open_tracks, tmp_path / "missing", match=r"no such file or folder.*pass a scan file")
    pipe = tmp_path / "pipe.ply"
    os.mkfifo(pipe)
    refused(open_tracks, pipe, match=r"pipe\.ply: a pipe; write it to a file and pass a scan")
    pipe.unlink()
    refused(open_tracks, tmp_path, match=r"an empty folder.*pass a scan file")
    (tmp_path / "a.pdf").write_text("")
    refused(open_tracks, tmp_path, match="1 other entries")
    refused(open_tracks, tmp_path / "a.pdf", match=r"a\.pdf: no scan file")
    (tmp_path / "t" / "scans").mkdir(parents=True)
    refused(open_tracks, tmp_path / "t", match="holds no scan")


def test_unit(dataset: Path, tmp_path: Path, cloud: np.ndarray) -> None:
    np.savetxt(tmp_path / "a.xyz", cloud.astype(np.float64) * 1000)
    np.testing.assert_allclose(
        open_tracks(tmp_path / "a.xyz", Coordinates("mm"))[0].scans[0], cloud, rtol=1e-6
    )
    with pytest.raises(BadInputError, match="--unit mm"):
        open_tracks(tmp_path / "a.xyz")[0]


def test_links_to_one_track_are_two_tracks(dataset: Path) -> None:
    links = dataset.parent / "links"
    links.mkdir()
    for name in ("first", "second"):
        (links / name).symlink_to(dataset / "a")
    assert [track.name for track in open_tracks(links)] == ["first", "second"]


def test_one_scan_of_a_track_has_its_unit_and_sensor(dataset: Path) -> None:
    scan = dataset / "a" / "scans" / "000011.ply"
    (before,) = open_tracks(scan)
    (dataset / "a" / "track.json").write_text('{"unit": "cm", "sensor": "camera"}')
    (after,) = open_tracks(scan)
    assert after.sensor.kind == "camera"
    np.testing.assert_allclose(after.scans[0], before.scans[0] / 100, rtol=1e-5)


def test_scans_beside_tracks_are_not_passed_over(dataset: Path) -> None:
    for text in ("splits.txt", "README.TXT"):
        (dataset / "notes" / text).write_text("a b")
    assert open_tracks(dataset).names == ("a", "b")
    (dataset / "b" / "scans").rename(dataset / "c")
    (dataset / "b").rename(dataset / ".b")
    refused(open_tracks, dataset, match=r"c: has points, but no scans/; move its scans there")


def test_hidden_folders_are_no_tracks(dataset: Path) -> None:
    (dataset / "a").rename(dataset / ".a")
    assert open_tracks(dataset).names == ("b",)


def test_what_drives_found_is_one_dataset_whose_names_say_the_drive(dataset: Path, tmp_path):
    for drive in ("monday", "tuesday"):
        shutil.copytree(dataset, tmp_path / "found" / drive / "tracks")
        (tmp_path / "found" / drive / "boxes.csv").write_text("frame,time\n")
    source = open_tracks(tmp_path / "found")
    assert source.names == ("monday_a", "monday_b", "tuesday_a", "tuesday_b")
    assert tuple(track.name for track in source) == source.names
    for track, other in zip(source, [*open_tracks(dataset)] * 2, strict=True):
        for scan, same in zip(track.scans, other.scans, strict=True):
            np.testing.assert_array_equal(scan, same)


def test_what_drive_found_is_no_scan(tmp_path):
    (tmp_path / "boxes.csv").write_text("frame,time\n")
    (tmp_path / "tracks").mkdir()
    refused(open_tracks, tmp_path, match=r"holds what `drive` found; name .*tracks")
