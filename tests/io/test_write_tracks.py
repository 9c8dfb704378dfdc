# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Track folders that are written again where somebody keeps a file of his own."""

from dataclasses import replace
from pathlib import Path

import pytest
from tests.refusal import refused

from wildshape.io.store.store import open_store
from wildshape.io.tracks import read_track
from wildshape.io.write_tracks import write_tracks
from wildshape.records import Track


@pytest.fixture(params=["notes.txt", "scans/.DS_Store"])
def theirs(request: pytest.FixtureRequest, track: Track, tmp_path: Path) -> Path:
    """A file of somebody else's in the folder of a track that was written."""
    _write(track, tmp_path / "out")
    path = tmp_path / "out" / track.name / request.param
    path.write_text("mine")
    return path


def _write(track: Track, out: Path, *, overwrite: bool = False) -> None:
    settings = {"sizes": [len(scan) for scan in track.scans]}
    write_tracks(
        [track], out, "folders", command="simulate", settings=settings, overwrite=overwrite
    )


def _other(track: Track) -> Track:
    return replace(track, scans=track.scans[::-1])


def _assert_replaced(out: Path, track: Track, theirs: Path) -> None:
    found = read_track(out / track.name)
    assert [len(scan) for scan in found.scans] == [33, 20, 60]
    assert found.T_sensor_object is not None
    assert found.shape is not None
    assert theirs.read_text() == "mine"
    assert not (out / ".unfinished").exists()


def test_a_track_is_replaced_beside_a_file_of_somebody_else(
    theirs: Path, track: Track, tmp_path: Path
) -> None:
    """Its folder stayed for that file, and was taken for the new track."""
    _write(_other(track), tmp_path / "out", overwrite=True)
    _assert_replaced(tmp_path / "out", track, theirs)


@pytest.mark.parametrize("moves", range(4))
def test_killed_between_two_of_its_files_it_is_gone_on_with(
    theirs: Path, track: Track, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves: int
) -> None:
    real, left = Path.replace, iter([None] * moves)

    def killed(path: Path, target: Path) -> Path:
        places = (".unfinished" in path.parts, ".unfinished" in target.parts)
        if places == (True, False) and next(left, "stop") == "stop":
            raise KeyboardInterrupt
        return real(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            _write(_other(track), tmp_path / "out", overwrite=True)
    if theirs.parent.name != "scans":  # scans/ make it a track
        assert len([*theirs.parent.glob("scans/*")]) in (0, 3)
    _write(_other(track), tmp_path / "out")
    _assert_replaced(tmp_path / "out", track, theirs)


@pytest.mark.parametrize("text", ["[]", '{"provenance": null}', '{"provenance": [1]}', "\xff", "{"])
def test_a_damaged_half_written_store_is_refused_and_can_be_replaced(
    track: Track, tmp_path: Path, text: str
) -> None:
    """What said who was writing it ended the command with an error of Python's."""
    out = tmp_path / "store"
    out.mkdir()
    (out / "writing.json").write_bytes(text.encode("latin-1"))

    def write(*, overwrite: bool) -> None:
        write_tracks([track], out, "packed", command="simulate", settings={}, overwrite=overwrite)

    refused(write, overwrite=False, match="a half-written packed store is there already")
    write(overwrite=True)
    assert open_store(out).names == (track.name,)
