# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""`wildshape evaluate-drive` on a simulated drive."""

import json
import shutil

import numpy as np
import pytest

from wildshape.cli.main import main
from wildshape.io.scans.writers import write_ply

SCANS = 3


def write_frames(found, street):
    """As `wildshape drive` does."""
    scans = sorted((street / "velodyne" / "0000").glob("*.bin"))
    rows = (f"{i},{scan.stem},,{scan.stat().st_size // 16}\n" for i, scan in enumerate(scans))
    (found / "frames.csv").write_text(f"frame,scan,time,points\n{''.join(rows)}")


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """A simulated drive."""
    path = tmp_path_factory.mktemp("street") / "street"
    main(["simulate", str(path), "--drive", "--scans", str(SCANS), "--seed", "5"])
    return path


@pytest.fixture
def found(street, tmp_path):
    """What a drive that knows the truth would have written."""
    folder = tmp_path / "found"
    folder.mkdir()
    shutil.copy(street / "truth" / "0000.csv", folder / "boxes.csv")
    shutil.copy(street / "poses" / "0000.txt", folder / "trajectory.txt")
    return folder


def test_a_range_that_does_not_count_is_said(wildshape, street, found):
    words = ("evaluate-drive", found, "--labels", street, "--json")
    plain, near = wildshape(*words), wildshape(*words, "--range", "20")
    assert json.loads(near.out)["methods"] == json.loads(plain.out)["methods"]
    assert "--range 20 is no limit" in near.err
    assert "--range" not in plain.err


def test_the_truth_is_right(wildshape, street, found, tmp_path):
    out = tmp_path / "evaluation"
    said = wildshape("evaluate-drive", found, "--labels", street, "--out", out, "--json")
    assert said.code == 0, said
    metrics = json.loads(said.out)
    ours = metrics["methods"]["wildshape"]
    # Labels hold six digits after the point.
    assert [one["average_precision"] for one in ours["detections"]] == [1, 1, 1, 1]
    assert ours["hota"]["hota"] == pytest.approx(1)
    assert ours["size_bias_m"] == pytest.approx([0, 0, 0], abs=1e-5)
    for name, plain in metrics["methods"].items():  # around the points in the boxes
        if name != "wildshape":
            assert 0 < plain["detections"][0]["average_precision"] < 1
            assert plain["labels"] == ours["labels"]
    assert metrics["trajectories"][0]["ate_m"] == pytest.approx(0, abs=1e-6)
    assert json.loads((out / "metrics.json").read_text())["methods"] == metrics["methods"]
    assert metrics["provenance"]["settings"]["points"] == 100
    vehicles = json.loads((out / "vehicles.json").read_text())["methods"]["wildshape"]
    assert all(one["found"] == one["scans"] for one in vehicles)
    assert "AP BEV 0.5" in (out / "table.md").read_text()


def _exchanged(words):
    return [*words[:11], words[12], words[11], *words[13:]]


def _from_the_middle(words):
    return [*words[:14], str(float(words[14]) - float(words[10]) / 2), *words[15:]]


def _but_of_the_first(words):
    return [] if words[0] == "0" else words


def _one_later(words):
    return [str(int(words[0]) + 1), *words[1:]] if int(words[0]) < SCANS - 1 else []


def _same(words):
    return words


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_same, ""),
        (_exchanged, "no box found lies on a label"),
        (_from_the_middle, "at other heights"),
        (_one_later, "in a scan fits the labels of the one after it better"),
        (_but_of_the_first, "1 of 3 scans without a label, the first 000000.bin"),
    ],
)
def test_labels_that_are_odd_are_told(wildshape, street, found, tmp_path, change, told):
    other = tmp_path / "other"
    shutil.copytree(street, other)
    path = other / "label_02" / "0000.txt"
    lines = [change(line.split()) for line in path.read_text().splitlines()]
    path.write_text("".join(f"{' '.join(words)}\n" for words in lines if words))
    said = wildshape("evaluate-drive", found, "--labels", other, "--json")
    assert said.code == 0, said
    assert told in said.err
    assert bool(told) == (str(other) in said.err)


def test_labels_of_another_frame_are_not_taken_for_those_of_another_scan(
    wildshape, street, found, tmp_path
):
    """Moved aside by 6 m hardly any is met; by chance more of those of the next scan are."""
    other = tmp_path / "other"
    shutil.copytree(street, other)
    path = other / "label_02" / "0000.txt"
    lines = [line.split() for line in path.read_text().splitlines()]
    moved = ([*words[:13], str(float(words[13]) + 6), *words[14:]] for words in lines)
    path.write_text("".join(f"{' '.join(words)}\n" for words in moved))
    said = wildshape("evaluate-drive", found, "--labels", other, "--json")
    assert said.code == 0, said
    assert "KITTI's frame and order" in said.err
    assert "numbered alike" not in said.err


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_measured(
    refused, street, found, tmp_path
):
    """Measuring many drives takes minutes."""
    none_counts = ("evaluate-drive", found, "--labels", street, "--points", "1000000")
    taken, new = tmp_path / "taken", tmp_path / "new"
    taken.mkdir()
    (taken / "notes.txt").write_text("mine")
    assert "taken: is not empty" in refused(*none_counts, "--out", taken)
    assert "no label counts" in refused(*none_counts, "--out", new)
    assert not new.exists()


def test_an_evaluation_stays_where_nothing_can_replace_it(
    wildshape, refused, street, found, tmp_path
):
    out = tmp_path / "out"
    command = ("evaluate-drive", found, "--labels", street, "--out", out)
    assert wildshape(*command).code == 0
    before = {path: path.read_bytes() for path in out.iterdir()}
    assert "no label counts" in refused(*command, "--overwrite", "--points", "1000000")
    assert {path: path.read_bytes() for path in out.iterdir()} == before


def test_half_a_drive_is_not_measured_against_all_labels(wildshape, street, found):
    poses = (found / "trajectory.txt").read_text().splitlines(keepends=True)
    (found / "trajectory.txt").write_text("".join(poses[:-1]))
    rows = (found / "boxes.csv").read_text().splitlines(keepends=True)
    kept = [row for row in rows if not row.startswith(f"{SCANS - 1},")]
    (found / "boxes.csv").write_text("".join(kept))
    said = wildshape("evaluate-drive", found, "--labels", street)
    assert said.code == 2
    assert f"is of {SCANS - 1} scans, but the labels know {SCANS}" in said.err


def test_plain_boxes_around_the_same_clusters(wildshape, street, found):
    """Of the points that lie in the true boxes."""
    rows = [line.split(",") for line in (found / "boxes.csv").read_text().splitlines()[1:]]
    for frame in range(SCANS):
        scan = street / "velodyne" / "0000" / f"{frame:06d}.bin"
        points = np.fromfile(scan, "<f4").reshape(-1, 4)[:, :3]
        for row in rows:
            x, y, z, length, width, height, yaw = map(float, row[3:10])
            c, s = np.cos(yaw), np.sin(yaw)
            own = (points - (x, y, z)) @ np.array(((c, -s, 0), (s, c, 0), (0, 0, 1)))
            inside = (np.abs(own) < np.array((length, width, height)) / 2 - (0, 0, 0.15)).all(1)
            if int(row[0]) == frame and inside.sum() >= 16:
                scans = found / "tracks" / row[2] / "scans"
                write_ply(scans / f"{frame:06d}.ply", points[inside])
    write_frames(found, street)
    said = wildshape("evaluate-drive", found, "--labels", street, "--json")
    assert said.code == 0, said
    methods = json.loads(said.out)["methods"]
    assert len(methods) == 3
    for name in ("clusters, smallest rectangles", "clusters, L-shape fits"):
        bev = methods[name]["detections"][0]["average_precision"]
        assert 0 < bev < methods["wildshape"]["detections"][0]["average_precision"]
        assert max(methods[name]["size_bias_m"]) < 0


def test_two_drives(wildshape, refused, street, found, tmp_path):
    """A folder each, and their labels under the same names."""
    drives, streets = tmp_path / "drives", tmp_path / "streets"
    streets.mkdir()
    for name in ("first", "second"):
        shutil.copytree(found, drives / name)
        (streets / name).symlink_to(street)
    said = wildshape("evaluate-drive", drives, "--labels", streets, "--json")
    assert said.code == 0, said
    assert len(json.loads(said.out)["trajectories"]) == 2
    (streets / "second").unlink()
    assert "no labels of the drive second" in refused("evaluate-drive", drives, "--labels", streets)


def test_sequences_of_one_folder(wildshape, street, found, tmp_path):
    """As KITTI tracking keeps them."""
    shutil.copytree(found, tmp_path / "drives" / "0000")
    said = wildshape("evaluate-drive", tmp_path / "drives", "--labels", street)
    assert said.code == 0, said
    assert "| wildshape | 100.0 | 100.0 | 100.0 | 100.0 | 100.0 |" in said.out


def test_scans_that_are_not_the_labelled_ones(wildshape, refused, street, found, tmp_path):
    """As many, of another place or of other numbers, are paired with no label."""
    write_frames(found, street)
    other = tmp_path / "other"
    shutil.copytree(street, other)
    first, *_, last = sorted((other / "velodyne" / "0000").glob("*.bin"))
    last.rename(last.with_stem("000009"))
    counted = wildshape("evaluate-drive", found, "--labels", other)
    assert counted.code == 0  # a bag has counts alone, whatever the numbers of its scans
    last.with_stem("000009").rename(last)
    names = (found / "frames.csv").read_text()
    (found / "frames.csv").write_text(names.replace(last.stem, "000009"))
    said = refused("evaluate-drive", found, "--labels", other)
    assert "has scan 000009 where the labels have" in said
    (found / "frames.csv").write_text(names)
    whole = first.read_bytes()
    first.write_bytes(whole + bytes(16))  # a pulse that did not come back
    assert wildshape("evaluate-drive", found, "--labels", other).code == 0
    first.write_bytes(whole[:-16])
    said = refused("evaluate-drive", found, "--labels", other)
    assert "scan 000000 has" in said
    assert str(first) in said


HEADER = "frame,time,track,x,y,z,length,width,height,yaw,confidence,points,moving"
ROW = "0,0.0,7,10,2,-1,4,1.8,1.5,0.1,0.9,200,0"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected the header"),
        ("frame,x\n", "expected the header"),
        (f"{HEADER}\n{ROW},1\n", "boxes.csv"),
        (f"{HEADER}\n0,0.0,7,10\n", "boxes.csv"),
        (f"{HEADER}\n{ROW.replace('10', 'ten')}\n", "boxes.csv"),
        (f"{HEADER}\n{ROW.replace('10', 'nan')}\n", "boxes.csv"),
        (f"{HEADER}\n{ROW.replace('4,', '-4,')}\n", "sizes are over 0"),
        (f"{HEADER}\n{ROW.replace('0.9', '90')}\n", "confidences 0 to 1"),
        (f"{HEADER}\n3{ROW[1:]}\n", "the labels know 3 scans"),
        (f"{HEADER}\n-1{ROW[1:]}\n", "the labels know 3 scans"),
        (f"{HEADER}\n{ROW}\n{ROW}\n", "twice"),
        (f"{HEADER}\n{ROW[:-1]}2\n", "boxes.csv"),
        ("\0\xff\n", "boxes.csv"),
    ],
)
def test_bad_boxes(refused, street, found, text, expected):
    (found / "boxes.csv").write_bytes(text.encode("latin-1"))
    said = refused("evaluate-drive", found, "--labels", street)
    assert expected in said
    assert str(found) in said


def test_other_bad_input(refused, street, found, tmp_path):
    assert "no boxes.csv" in refused("evaluate-drive", found / "none", "--labels", street)
    assert "no label_02" in refused("evaluate-drive", found, "--labels", tmp_path)
    assert "--points -1" in refused("evaluate-drive", found, "--labels", street, "--points", "-1")
    assert "--range" in refused("evaluate-drive", found, "--labels", street, "--range", "nan")
    (found / "trajectory.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    assert "trajectory.txt" in refused("evaluate-drive", found, "--labels", street)


def test_nothing_found(wildshape, street, found):
    (found / "boxes.csv").write_text(f"{HEADER}\n")
    (found / "trajectory.txt").unlink()
    said = wildshape("evaluate-drive", found, "--labels", street)
    assert said.code == 0, said
    assert "| wildshape | 0.0 | 0.0 | 0.0 | 0.0 | 0.0 |" in said.out
    assert "Trajectory" not in said.out
