# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from tests.cars import poses_of, shape_of
from tests.disk import full_disk
from tests.io.store.stores import assert_same
from tests.refusal import refused

from wildshape.errors import BadInputError
from wildshape.io.scans.points import Coordinates
from wildshape.io.scans.writers import write_ply
from wildshape.io.tracks import NoUsableScanError, read_track, read_track_file, write_track
from wildshape.records import Sensor, SightLines, Track


def test_round_trip(track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / track.name, track)
    found = read_track_file(tmp_path / track.name)
    assert found.skipped == ()
    assert_same(found.track, track)


def test_scans_alone_are_a_complete_track(tmp_path: Path, formats: dict[str, Path]) -> None:
    scans = tmp_path / "some track" / "scans"
    scans.mkdir(parents=True)
    for i, path in enumerate(formats.values()):
        (scans / f"{i:03d}{path.suffix}").write_bytes(path.read_bytes())
    (scans / ".hidden.ply").write_text("")
    (scans / "notes.md").write_text("")
    track = read_track(scans.parent)
    assert track.name == "some track"
    assert track.scan_names == tuple(f"{i:03d}" for i in range(len(formats)))
    assert track.sensor == Sensor()
    assert track.T_sensor_object is None
    assert track.shape is None


def test_a_bad_scan_is_skipped_with_its_pose(track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", track)
    (tmp_path / "t" / "scans" / "000011.ply").write_bytes(b"ply\nbroken")
    found = read_track_file(tmp_path / "t")
    assert [name for name, _ in found.skipped] == ["000011.ply"]
    assert "000011.ply" in found.skipped[0][1]
    assert found.track.scan_names == ("000010", "000012")
    poses, truth = found.track.T_sensor_object, track.T_sensor_object
    assert poses is not None
    assert truth is not None
    assert torch.equal(poses.matrix, truth.matrix[[0, 2]])


def test_dropped_points_are_listed(track: Track, tmp_path: Path, cloud: np.ndarray) -> None:
    dirty = cloud.copy()
    dirty[4:6] = np.nan
    write_track(tmp_path / "t", replace(track, scans=(dirty, cloud, cloud)))
    assert read_track_file(tmp_path / "t").dropped_nonfinite == (("000010.ply", 2),)


def test_no_usable_scan_is_an_error(tmp_path: Path) -> None:
    write_ply(tmp_path / "scans" / "a.ply", np.zeros((3, 3), np.float32))
    with pytest.raises(NoUsableScanError, match="3 finite points") as caught:
        read_track(tmp_path)
    assert [name for name, _ in caught.value.skipped] == ["a.ply"]


def test_poses_of_another_length(track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", track)
    text = (tmp_path / "t" / "poses.txt").read_text()
    (tmp_path / "t" / "poses.txt").write_text("".join(text.splitlines(keepends=True)[:2]))
    refused(read_track, tmp_path / "t", match="2 lines of poses for 3 scans")


@pytest.mark.parametrize("said_by", ["track.json", "argument"])
def test_units_apply_to_everything(said_by: str, track: Track, tmp_path: Path) -> None:
    poses = poses_of(track)
    millimetres = replace(
        track,
        scans=tuple(scan * 1000 for scan in track.scans),
        shape=shape_of(track) * 1000,
        T_sensor_object=replace(poses, translation=poses.translation * 1000),
    )
    write_track(tmp_path / track.name, millimetres)
    info = tmp_path / track.name / "track.json"
    if said_by == "track.json":
        info.write_text(info.read_text().replace('"unit": "m"', '"unit": "mm"'))
        found = read_track(tmp_path / track.name)
    else:
        found = read_track(tmp_path / track.name, Coordinates("mm"))
    for scan, truth in zip(found.scans, track.scans):
        np.testing.assert_allclose(scan, truth, rtol=1e-6)
    np.testing.assert_allclose(shape_of(found), shape_of(track), rtol=1e-6)
    torch.testing.assert_close(poses_of(found).matrix, poses.matrix)


def test_a_unit_that_track_json_alone_names_is_named_as_what_to_drop(
    track: Track, tmp_path: Path
) -> None:
    write_track(tmp_path / "t", track)
    info = tmp_path / "t" / "track.json"
    info.write_text(info.read_text().replace('"unit": "m"', '"unit": "mm"'))
    refused(read_track, tmp_path / "t", match='drop --unit, or the "unit" of its track.json')


def _camera(key: str, value: str) -> str:
    """track.json of a camera with one value replaced."""
    values = dict.fromkeys(("fx", "fy", "cx", "cy", "width", "height"), "7") | {key: value}
    return '{"intrinsics": {' + ", ".join(f'"{k}": {v}' for k, v in values.items()) + "}}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "track.json: expected JSON"),
        ("[1]", "the keys of a track, found list"),
        ('{"unit": "inch"}', "unit 'inch' is unknown"),
        ('{"unit": [1]}', "unit"),
        ('{"sensor": "radar"}', "sensor 'radar' is unknown"),
        ('{"resolution_deg": 0.2}', "resolution_deg"),
        ('{"resolution_deg": ["a", 1]}', "resolution_deg"),
        ('{"resolution_deg": [0.2, NaN]}', "no angles"),
        ('{"intrinsics": {"fx": 1}}', "intrinsics"),
        (_camera("fx", "NaN"), "no camera"),
        (_camera("fy", "-1"), "no camera"),
        (_camera("cx", "1e400"), "no camera"),
        (_camera("width", "0"), "no camera"),
        (_camera("width", "1" + 400 * "0"), "no camera"),
        (_camera("height", "Infinity"), "OverflowError"),
    ],
)
def test_a_damaged_track_json(text: str, said: str, track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", track)
    (tmp_path / "t" / "track.json").write_text(text)
    refused(read_track, tmp_path / "t", match=said)


def test_a_shape_without_points_is_no_truth(track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "car", track)
    write_ply(tmp_path / "car" / "shape.ply", np.zeros((0, 3), np.float32))
    refused(read_track, tmp_path / "car", match=r"shape\.ply: holds no finite points")


def test_an_existing_track_is_not_mixed(track: Track, tmp_path: Path) -> None:
    write_track(tmp_path / "t", track)
    refused(write_track, tmp_path / "t", track, match="holds a track already")


@pytest.mark.parametrize("cut", ["scans", "scan_names", "rays", "T_sensor_object"])
def test_a_track_whose_parts_do_not_fit_is_refused_before_scans_are_lost(
    cut: str, track: Track, tmp_path: Path
) -> None:
    ray = SightLines(np.eye(3), np.ones(3))
    whole = replace(track, rays=(ray,) * len(track.scans))
    with pytest.raises(BadInputError, match="do not fit together"):
        write_track(tmp_path / "t", replace(whole, **{cut: getattr(whole, cut)[:2]}))
    assert list(tmp_path.iterdir()) == []


def test_names_that_would_not_sort_in_time_become_numbers(track: Track, tmp_path: Path) -> None:
    for names in (("10", "9", "8"), ("a/b", "c", "d"), ("a", "a", "b"), ("a", "a-b", "c")):
        folder = tmp_path / names[0].replace("/", "-") / names[1]
        write_track(folder, replace(track, scan_names=names))
        found = read_track(folder)
        assert found.scan_names == ("000000", "000001", "000002")
        assert [len(scan) for scan in found.scans] == [60, 20, 33]


def test_names_whose_files_sort_in_time_are_kept(track: Track, tmp_path: Path) -> None:
    """`a-b.ply` is before `a.ply`, though `a` is before `a-b`: scans came back in another order."""
    names = ("a-b", "a", "c")
    write_track(tmp_path / "t", replace(track, scan_names=names))
    found = read_track(tmp_path / "t")
    assert found.scan_names == names
    assert [len(scan) for scan in found.scans] == [60, 20, 33]


def test_a_full_disk_names_the_scan(tmp_path: Path) -> None:
    track = Track("t", (np.ones((1000, 3), np.float32),), ("000000",))
    with full_disk(5_000, tmp_path / "t" / "scans" / "000000.ply"):
        write_track(tmp_path / "t", track)
