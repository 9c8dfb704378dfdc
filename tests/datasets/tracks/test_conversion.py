# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A part is converted as a whole or not at all, in memory that does not grow with it."""

import shutil
import tracemalloc
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from tests.cars import drive_by, poses_of, shape_of

from wildshape.datasets.destinations import PackedStore, TrackFolders
from wildshape.datasets.tracks.conversion import STORE, TRACKS, convert_part, finished_part
from wildshape.datasets.tracks.source import Source
from wildshape.datasets.tracks.truth import TruthBuilder
from wildshape.errors import BadInputError
from wildshape.io.store import join
from wildshape.io.store.layout import INDEX_JSON, PARTS
from wildshape.io.store.store import open_store
from wildshape.io.tracks import read_track
from wildshape.records import Track


@dataclass
class Made:
    """Tracks of 20 scans of 1000 points; the last of them may be a file that is damaged."""

    tracks: int
    damaged: bool = False
    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self):
        return ["part"]

    def tracks_of(self, part):
        for i in range(self.tracks):
            self.rejected["scan: too far"] += 1
            points = np.random.default_rng(i).normal(size=(20, 1000, 3)).astype(np.float32)
            yield Track(f"{part}{i}", tuple(points), tuple(f"{i}-{k}" for k in range(20)))
        if self.damaged:
            raise BadInputError("scan.bin: truncated; download it again.")


def test_a_part_is_a_store_with_its_figures(tmp_path):
    source = Made(3)
    assert isinstance(source, Source)
    result = convert_part(source, "part", tmp_path / "0")
    assert (result.tracks, result.scans, result.points) == (3, 60, 60_000)
    assert result.left_out == {"scan: too far": 3}
    assert finished_part(tmp_path / "0", "part") == result
    assert open_store(tmp_path / "0" / STORE).names == ("part0", "part1", "part2")
    assert not source.rejected  # a worker counts on its own copy


def test_a_part_of_folders(tmp_path):
    result = convert_part(Made(2), "part", tmp_path / "0", layout="folders")
    assert result.names == ["part0", "part1"]
    assert len(read_track(tmp_path / "0" / TRACKS / "000001").scans) == 20
    assert finished_part(tmp_path / "0", "part") == result


def test_a_part_without_tracks_is_finished_too(tmp_path):
    result = convert_part(Made(0), "part", tmp_path / "0")
    assert (result.tracks, finished_part(tmp_path / "0", "part")) == (0, result)


@pytest.mark.parametrize("layout", ["packed", "folders"])
def test_a_damaged_part_leaves_nothing(tmp_path, layout):
    with pytest.raises(BadInputError, match="truncated"):
        convert_part(Made(3, damaged=True), "part", tmp_path / "parts" / "0", layout=layout)
    assert list((tmp_path / "parts").iterdir()) == []


def test_what_is_not_whole_or_not_this_part_is_not_finished(tmp_path):
    folder = tmp_path / "0"
    assert finished_part(folder, "part") is None
    convert_part(Made(2), "part", folder)
    assert finished_part(folder, "other") is None
    shard = folder / STORE / "points-00000.safetensors"
    shard.write_bytes(shard.read_bytes()[:-1])
    assert finished_part(folder, "part") is None
    convert_part(Made(2), "part", folder)
    assert finished_part(folder, "part") is not None
    shutil.rmtree(folder / STORE)
    assert finished_part(folder, "part") is None


def test_the_first_of_two_that_make_one_part_stays(tmp_path):
    convert_part(Made(2), "part", tmp_path / "0")
    before = (tmp_path / "0" / "part.json").stat().st_ino
    convert_part(Made(2), "part", tmp_path / "0")
    assert (tmp_path / "0" / "part.json").stat().st_ino == before
    assert [path.name for path in tmp_path.iterdir()] == ["0"]


def test_a_conversion_killed_while_it_names_its_index_leaves_nothing(tmp_path, monkeypatch):
    out = tmp_path / "store"
    destination = PackedStore(out, {}, overwrite=False)
    destination.begin()
    result = convert_part(Made(2), "part", out / PARTS / "0")
    real = join.write_json

    def killed(path, data, *, flush):
        if path.name == INDEX_JSON:
            (out / ".killed.part").write_bytes(b"{")
            raise KeyboardInterrupt
        real(path, data, flush=flush)

    with monkeypatch.context() as patch:
        patch.setattr(join, "write_json", killed)
        with pytest.raises(KeyboardInterrupt):
            destination.finish([(out / PARTS / "0", result)])
    assert PackedStore(out, {}, overwrite=False).begin() == [result]
    assert len(open_store(out)) == 2
    assert not list(out.glob(".*"))


@pytest.mark.parametrize("place", ["notes.txt", "scans/.DS_Store"])
def test_folders_are_replaced_beside_a_file_of_somebody_else(tmp_path, place):
    """All work was done, and then a folder was 'not empty', at every repetition."""
    out = tmp_path / "out"
    for tracks in (1, 2):
        destination = TrackFolders(out, {"tracks": tracks}, overwrite=tracks == 2)
        destination.begin()
        result = convert_part(Made(tracks), "part", out / PARTS / "0", layout="folders")
        destination.finish([(out / PARTS / "0", result)])
        (out / "part0" / place).write_text("mine")
    assert [len(read_track(out / name).scans) for name in ("part0", "part1")] == [20, 20]
    assert (out / "part0" / place).read_text() == "mine"
    assert not (out / PARTS).exists()


def test_memory_does_not_grow_with_the_part(tmp_path):
    peaks = []
    for tracks in (5, 50):
        tracemalloc.start()
        convert_part(Made(tracks), "part", tmp_path / f"{tracks}")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.2 * peaks[0] < 3e6


@dataclass
class Posed:
    """One track with poses and no shape, another without either."""

    rejected: dict[str, int] = field(default_factory=Counter, init=False)

    def parts(self):
        return ["part"]

    def tracks_of(self, part):
        seen = replace(drive_by("seen", scans=9), shape=None)
        yield seen
        yield replace(seen, name="bare", T_sensor_object=None)


def test_truth_is_built_where_poses_are(tmp_path):
    truth = TruthBuilder("mirrored")
    result = convert_part(Posed(), "part", tmp_path / "0", truth=truth)
    assert result.left_out == {"truth: no shape, for the object has no poses": 1}
    stripped = convert_part(Posed(), "part", tmp_path / "1", truth=replace(truth, strip=9.0))
    assert stripped.left_out == result.left_out | {"truth: no shape, for no point is left of it": 1}
    seen, bare = open_store(tmp_path / "0" / STORE)
    assert np.ptp(shape_of(seen), axis=0) == pytest.approx([4.2, 1.7, 1.35], abs=0.1)
    assert bare.shape is None


def test_poses_the_wrong_way_round_are_doubted(tmp_path):
    class Inverted(Posed):
        def tracks_of(self, part):
            for track in (drive_by(name, scans=5) for name in ("a", "b")):
                given = poses_of(track)
                yield replace(track, T_sensor_object=given.inverse())

    (said,) = convert_part(Inverted(), "part", tmp_path / "0").doubts  # of the first alone
    assert "check unit, frame and direction of its poses" in said
    assert convert_part(Posed(), "part", tmp_path / "1").doubts == []


def stray_and_ground(track):
    """A track whose first scan also saw a bird, and ground beside the car's wheels."""
    poses = track.T_sensor_object
    rng = np.random.default_rng(0)
    ground = rng.uniform((-2, -1, -0.75), (2, 1, -0.72), (2000, 3))
    more = np.concatenate((ground, [[0, 0, 4.0]])).astype(np.float32)
    first = np.concatenate((track.scans[0], poses[0].apply_numpy(more)))
    return replace(track, scans=(first, *track.scans[1:]), shape=None)


@pytest.mark.parametrize(
    ("outliers", "top"), [("none", 4.0), ("radius", 0.8), ("statistical", 0.8)]
)
def test_outliers_and_the_ground_strip(outliers, top):
    track = stray_and_ground(drive_by(scans=5))
    whole = heights(TruthBuilder(outliers=outliers), track)
    assert whole.max() == pytest.approx(top, abs=0.1)
    assert whole.min() < -0.7
    cut = heights(TruthBuilder(outliers=outliers, strip=0.1), track)
    assert -0.66 < cut.min() < -0.55


def heights(truth, track):
    shaped = truth.with_shape(track)
    assert shaped is not None
    return shaped.shape[:, 2]


def test_no_poses_no_shape():
    assert TruthBuilder().with_shape(replace(drive_by(scans=2), T_sensor_object=None)) is None
