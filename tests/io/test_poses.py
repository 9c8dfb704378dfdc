# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest
import torch
from tests.cars import poses_of
from tests.refusal import refused

from wildshape.io.poses import read_poses, write_poses
from wildshape.records import Track

_ROW = "1 0 0 5 0 1 0 6 0 0 1 7"


def test_round_trip_keeps_every_bit(track: Track, tmp_path: Path) -> None:
    poses = poses_of(track)
    write_poses(tmp_path / "poses.txt", poses)
    back = read_poses(tmp_path / "poses.txt", expected=3)
    assert torch.equal(back.matrix, poses.matrix)
    assert [len(r.split()) for r in (tmp_path / "poses.txt").read_text().splitlines()] == [12] * 3


def test_row_major_order(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0 -1 0 5 1 0 0 6 0 0 1 7\n\n")
    pose = read_poses(tmp_path / "a.txt")[0]
    point = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)
    assert pose.apply(point).tolist() == [[5, 7, 7]]


def test_poses_in_a_map_may_be_in_millimetres(tmp_path: Path) -> None:
    """A northing of UTM is up to 1e10 mm; `--unit mm --origin` brings it to the sensor."""
    (tmp_path / "a.txt").write_text("1 0 0 4e8 0 1 0 9.9e9 0 0 1 1e5\n")
    assert read_poses(tmp_path / "a.txt").translation.tolist() == [[4e8, 9.9e9, 1e5]]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"{_ROW}\n", r"1 lines of poses for 2 scans"),
        (f"{_ROW}\n{_ROW}\n{_ROW}\n", r"3 lines of poses for 2 scans"),
        (f"{_ROW}\n1 2 3\n", r"line 2: expected 12 finite numbers"),
        (f"{_ROW}\n{_ROW} 1\n", r"line 2: expected 12"),
        (f"{_ROW}\nnan{_ROW[1:]}\n", r"line 2: expected 12 finite"),
        (f"{_ROW}\n{_ROW.rpartition(' ')[0]} 1e200\n", r"line 2: expected 12 finite"),
        (f"{_ROW}\n{_ROW.replace('1', '2')}\n", r"line 2: .*determinant 8\.0000"),
        (f"{_ROW}\n-{_ROW}\n", r"line 2: .*determinant -1\.0000"),
        (f"{_ROW}\n1 0.1{_ROW[3:]}\n", r"line 2: .*determinant 1\.0000"),
        (f"{_ROW}\n{_ROW.replace('1', '0')}\n", r"line 2: .*determinant 0\.0000"),
        ("", "0 lines"),
        ("\x00\xff", "line 1: expected 12"),
    ],
)
def test_wrong_lines_are_named(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text(text)
    refused(read_poses, tmp_path / "poses.txt", expected=2, match=rf"poses\.txt.*{said}")


def test_missing_file(tmp_path: Path) -> None:
    refused(read_poses, tmp_path / "poses.txt", match="no such file")
