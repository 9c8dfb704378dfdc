# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Twice the scans, at most 2.3 times the work, counted in calls of functions."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.datasets.tracks.whole_tracks import Folder
from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.io import tracks
from wildshape.io.inputs import open_tracks
from wildshape.io.scans.points import ScanFile
from wildshape.io.tracks import read_track_file, write_poses
from wildshape.report.results import Inputs, read_result
from wildshape.report.statistics.statistics import statistics_of_tracks

_MOST = 2.3


@contextmanager
def _counting(counts: list[int]) -> Iterator[None]:
    made = 0

    def count(_frame: object, event: str, _what: object) -> None:
        nonlocal made
        made += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(None)
    counts.append(made)


def _track(folder: Path, scans: int) -> Path:
    (folder / "scans").mkdir(parents=True)
    for i in range(scans):
        (folder / "scans" / f"{i:06d}.npy").touch()
    eye = torch.eye(3, dtype=torch.float64).repeat(scans, 1, 1)
    write_poses(folder / "poses.txt", SE3(eye, torch.zeros(scans, 3, dtype=torch.float64)))
    return folder


@pytest.fixture(autouse=True)
def quickly_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that what is counted is not the reading of the points; every third cannot be used."""
    scan = ScanFile(np.array([9, 0, 0], np.float32) + np.eye(20, 3, dtype=np.float32), 0)

    def read(path: Path, _: object) -> ScanFile:
        if int(path.stem) % 3 == 0:
            raise BadInputError(f"{path}: damaged")
        return scan

    monkeypatch.setattr(tracks, "read_scan", read)


def _results(folder: Path, scans: int) -> Path:
    """What `complete` leaves, as far as it is read here."""
    folder.mkdir()
    box = {"centre": [9, 0, 0], "size": [4, 2, 1], "quaternion_wxyz": [1, 0, 0, 0]}
    said = [{"scan": f"{i:06d}", "box": box} for i in range(scans)]
    (folder / "objects.json").write_text(json.dumps({"track": "t", "scans": said}))
    return folder


def _of_reading(path: Path) -> object:
    source = open_tracks(path)
    return [source.skipped_in(track.name) for track in source]


@pytest.mark.parametrize(
    ("make", "use"),
    [
        (_track, read_track_file),
        (_track, _of_reading),
        (_track, lambda path: statistics_of_tracks(open_tracks(path), [0], lambda _: None)),
        (_track, lambda path: [list(Folder(path).tracks_of(p)) for p in Folder(path).parts()]),
        (_results, lambda path: read_result(path, Inputs())),
    ],
    ids=["track", "command", "info", "convert folder", "results"],
)
def test_many_scans(
    make: Callable[[Path, int], Path], use: Callable[[Path], object], tmp_path: Path
) -> None:
    counts: list[int] = []
    use(make(tmp_path / "first", 4))  # imports
    for scans in (300, 600):
        path = make(tmp_path / str(scans), scans)
        with _counting(counts):
            use(path)
    assert counts[1] < _MOST * counts[0], counts


class _Name(str):
    """Counts how often it is compared."""

    compared = 0
    __hash__ = str.__hash__

    def __eq__(self, other: object) -> bool:
        _Name.compared += 1
        return str.__eq__(self, other)


def test_many_tracks_are_found_by_name_without_a_search() -> None:
    counts = []
    for count in (200, 400):
        _Name.compared = 0
        source = open_tracks(Path(__file__).parents[2] / "examples" / "scan.npy")
        source.names = tuple(_Name(f"{i:06d}") for i in range(count))
        assert [source.numbers[f"{i:06d}"] for i in range(count)] == list(range(count))
        counts.append(_Name.compared)
    assert counts[1] <= _MOST * counts[0], counts
