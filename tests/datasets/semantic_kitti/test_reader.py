# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A sequence written here in SemanticKITTI's own layout, with known cars."""

import math

import numpy as np
import pytest
from tests.cars import off_surface, poses_of
from tests.datasets.damaged import passed_over
from tests.datasets.street import moved, rigid, street
from tests.datasets.write_semantic_kitti import (
    EYE,
    LABELS,
    ROAD,
    labels_of,
    velo_poses,
    write_calibration,
    write_frame,
    write_sequence,
)
from tests.refusal import refusal_of

from wildshape.datasets.semantic_kitti.labels import CLASSES
from wildshape.datasets.semantic_kitti.reader import PAPER, SPLITS, SemanticKitti
from wildshape.datasets.tracks.selection import Selection
from wildshape.datasets.tracks.truth import fuse_by_truth, shape_mirrored, shape_partial
from wildshape.errors import BadInputError

FRAMES = 6
PARKED, MOVING = "00_car_00007", "00_moving-car_00007"


@pytest.fixture(scope="module")
def scene():
    return street(FRAMES, points=2500, eye=EYE)


@pytest.fixture
def sequence(scene, tmp_path):
    return write_sequence(tmp_path / "dataset" / "sequences" / "00", scene)


def tracks(root, **options):
    source = SemanticKitti(root, **options)
    return {track.name: track for part in source.parts() for track in source.tracks_of(part)}


def true_poses(scene, name):
    return [
        np.linalg.inv(T) @ scene.T_world_object[name][i] for i, T in enumerate(velo_poses(scene))
    ]


def test_points_land_back_on_the_parked_car(sequence, scene):
    """The frame is the reader's choice, but the same for all scans: one step takes it to ours."""
    track = tracks(sequence)[PARKED]
    assert track.scan_names == tuple(f"{i:06d}" for i in range(FRAMES))
    truth = true_poses(scene, "parked")
    T_true_found = np.linalg.inv(truth[0]) @ np.asarray(poses_of(track)[0])
    for i, scan in enumerate(track.scans):
        assert len(scan) > 500
        found = poses_of(track)[i].inverse().apply_numpy(scan.astype(float))
        assert off_surface(moved(T_true_found, found)).max() < 1e-3
        # So is the sensor: at the origin of each scan, where it was in the world.
        eye = moved(np.linalg.inv(truth[i]), np.zeros((1, 3)))
        assert moved(T_true_found, poses_of(track)[i].inverse().translation.numpy()[None]) == (
            pytest.approx(eye, abs=1e-3)
        )


def test_rays_begin_where_the_sensor_was(sequence, scene):
    """It goes 2 m a turn, which is behind over the left side; scans are as of the turn's middle."""
    places = velo_poses(scene)
    rays = tracks(sequence, rays=True)[PARKED].rays[4]
    assert rays is not None
    share = -np.arctan2(rays.ends[:, 1], rays.ends[:, 0])[:, None] / (2 * np.pi)
    there = moved(np.linalg.inv(places[4]), np.array([places[3][:3, 3], places[5][:3, 3]]))
    assert share.mean() < -0.1
    assert np.abs(rays.starts - share * (there[1] - there[0]) / 2).max() < 0.051 * 2


def test_the_chosen_frame_is_that_of_the_car_but_for_front_and_back(sequence, scene):
    """Half of it is seen: the rear, the side, the roof; so the box knows all three lengths."""
    track = tracks(sequence)[PARKED]
    T = np.linalg.inv(true_poses(scene, "parked")[0]) @ np.asarray(poses_of(track)[0])
    assert abs(math.degrees(math.atan2(T[1, 0], T[0, 0]))) < 3
    assert abs(math.degrees(math.acos(T[2, 2]))) < 3
    assert T[:3, 3] == pytest.approx(0, abs=0.12)
    for shape in (shape_partial(track), shape_mirrored(track), fuse_by_truth(track)):
        assert np.ptp(shape, axis=0) == pytest.approx((4.2, 1.7, 1.35), abs=0.25)
    assert "its points fill 4." in track.source


def test_a_label_stays_with_its_point_where_others_have_no_place(sequence, scene):
    for frame in range(FRAMES):
        points = moved(np.linalg.inv(velo_poses(scene)[frame]), scene.clouds[frame])
        labels = labels_of(scene, frame, LABELS)
        points[np.flatnonzero(labels != ROAD)[::2]] = np.nan
        write_frame(sequence, frame, points, labels)
    for i, scan in enumerate(tracks(sequence)[PARKED].scans):
        T_object_velo = np.linalg.inv(true_poses(scene, "parked")[i])
        assert off_surface(moved(T_object_velo, scan.astype(float))).max() < 1e-4


def test_points_of_no_instance_are_of_no_object(scene, tmp_path):
    labels = {"parked": 10, "moving": LABELS["moving"]}
    assert list(tracks(write_sequence(tmp_path / "00", scene, labels))) == [MOVING]


def test_classes_are_named_standing_and_then_moving():
    for standing, *moving in CLASSES.values():
        assert standing < 100
        assert all(252 <= number <= 259 for number in moving)


def test_what_moved_has_no_truth(sequence, scene):
    found = tracks(sequence)
    assert list(found) == [PARKED, MOVING]
    assert found[MOVING].T_sensor_object is None
    assert found[MOVING].category == found[PARKED].category == "car"
    for i, scan in enumerate(found[MOVING].scans):
        T_object_velo = np.linalg.inv(true_poses(scene, "moving")[i])
        assert off_surface(moved(T_object_velo, scan.astype(float))).max() < 1e-4


@pytest.mark.parametrize(("motion", "name"), [("parked", PARKED), ("moving", MOVING)])
def test_motion_is_known_by_class(sequence, motion, name):
    assert list(tracks(sequence, selection=Selection(motion=motion))) == [name]


def test_the_papers_selection(sequence):
    assert list(tracks(sequence, selection=PAPER)) == [PARKED]
    strict = SemanticKitti(sequence, Selection(motion="parked", min_mean_points=10**5))
    assert list(strict.tracks_of("00")) == []
    assert strict.rejected == {"object: fewer than 100000 points on average": 1}


@pytest.mark.parametrize("level", range(3))
def test_root_may_be_a_sequence_or_above(sequence, level):
    assert len(tracks((sequence, *sequence.parents)[level])) == 2
    assert len(tracks(sequence.parents[2])) == 2


def test_splits_are_whole(sequence, scene):
    root = sequence.parents[1]
    with pytest.raises(
        BadInputError, match=r"split test lacks the sequences 08 .*: add them, or take"
    ):
        SemanticKitti(root, split="test").parts()
    write_sequence(sequence.parent / "08", scene)
    assert SemanticKitti(root, split="test").parts() == ["08"]
    with pytest.raises(
        BadInputError, match="split train lacks the sequences 01 02 03 04 05 06 07 09 10"
    ):
        SemanticKitti(root, split="train").parts()
    assert SemanticKitti(root).parts() == ["00", "08"]
    for name in SPLITS["train"]:
        (sequence.parent / name / "velodyne").mkdir(parents=True, exist_ok=True)
        (sequence.parent / name / "labels").mkdir(exist_ok=True)
    assert SemanticKitti(root, split="train").parts() == list(SPLITS["train"])
    assert "08" not in SPLITS["train"]


def test_a_sequence_without_labels_among_others_is_counted(sequence):
    (sequence.parent / "11" / "velodyne").mkdir(parents=True)
    source = SemanticKitti(sequence.parent)
    assert source.parts() == ["00", "11"]
    assert list(source.tracks_of("11")) == []
    assert source.rejected == {"sequence without a folder labels": 1}


def test_labels_may_lie_in_a_folder_of_another_name(sequence):
    (sequence / "labels").rename(sequence / "mine")
    assert len(tracks(sequence, labels="mine")) == 2


def write_passing(folder, visible, labels=LABELS):
    """As `street`, with the parked car labelled in some frames alone."""
    scene = street(len(visible), points=2500, eye=EYE)
    write_sequence(folder, scene, labels)
    for i, seen in enumerate(visible):
        found = labels_of(scene, i, labels)
        if not seen:
            found[found == labels["parked"]] = ROAD
        found.tofile(folder / "labels" / f"{i:06d}.label")
    return folder


def test_an_object_that_is_seen_again_is_one_unless_asked(tmp_path):
    folder = write_passing(tmp_path / "00", (1, 1, 0, 0, 1, 1))
    parked = Selection(motion="parked")
    (whole,) = tracks(folder, selection=parked).values()
    assert whole.scan_names == ("000000", "000001", "000004", "000005")
    assert list(tracks(folder, selection=parked, gap=2)) == [PARKED]
    first, again = tracks(folder, selection=parked, gap=1).values()
    assert (first.name, again.name) == (PARKED, f"{PARKED}_2")
    assert first.scan_names + again.scan_names == whole.scan_names
    assert len(tracks(folder, selection=parked, gap=0)) == 2


def test_objects_are_handed_out_right_after_their_last_frame(tmp_path):
    """So that memory does not grow with a sequence: the frames behind are not read yet."""
    folder = write_passing(tmp_path / "00", (1, 1, 0, 0, 0, 0))
    scan = folder / "velodyne" / "000003.bin"
    scan.write_bytes(b"broken")
    source = SemanticKitti(folder)
    stream = source.tracks_of("00")
    assert next(stream).name == PARKED
    scan.unlink()
    list(stream)
    assert "scan: the frame has no LiDAR file" in source.rejected


def test_few_points_are_no_scan_and_every_second_frame(sequence, scene):
    counts = [int((labels_of(scene, i, LABELS) == LABELS["parked"]).sum()) for i in range(6)]
    least = sorted(counts)[2]
    source = SemanticKitti(sequence, Selection(min_points=least, motion="parked"))
    (track,) = source.tracks_of("00")
    assert [len(scan) for scan in track.scans] == [n for n in counts if n >= least]
    assert source.rejected == {f"scan: fewer than {least} points on the object": 2}
    (track,) = tracks(sequence, selection=Selection(every=2, motion="parked")).values()
    assert track.scan_names == ("000000", "000002", "000004")


def test_a_label_used_in_two_places_makes_no_track(tmp_path):
    scene = street(FRAMES, points=2500, eye=EYE)
    first = scene.T_world_object["parked"][0]
    scene.T_world_object["parked"] = [first] * 3 + [first @ rigid(12, 0, 0)] * 3
    for cloud in scene.clouds[3:]:
        on_car = off_surface(moved(np.linalg.inv(first), cloud)) < 1e-6
        cloud[on_car] += first[:3, :3] @ (12, 0, 0)
    source = SemanticKitti(write_sequence(tmp_path / "00", scene))
    assert [track.name for track in source.tracks_of("00")] == [MOVING]
    assert source.rejected == {"object: its label lies in several places": 1}


def test_frames_without_a_scan_are_counted(sequence):
    (sequence / "velodyne" / "000002.bin").unlink()
    source = SemanticKitti(sequence)
    assert [len(track.scans) for track in source.tracks_of("00")] == [FRAMES - 1] * 2
    assert source.rejected == {"scan: the frame has no LiDAR file": 2}


refused = refusal_of(tracks)


def test_a_wrong_root_says_what_was_expected_and_found(tmp_path):
    refused(tmp_path / "nowhere", "nowhere: no such folder; give SemanticKITTI's folder with seq")
    refused(tmp_path, "found an empty folder; give")
    (tmp_path / "label_02").mkdir()
    refused(tmp_path, "found label_02; give")


def test_own_labels_need_neither_calibration_nor_poses(sequence):
    with_poses = {track.name: track for track in SemanticKitti(sequence).tracks_of("00")}
    (sequence / "calib.txt").unlink()
    (sequence / "poses.txt").unlink()
    bare = {track.name: track for track in SemanticKitti(sequence).tracks_of("00")}
    assert set(bare) == set(with_poses)
    for name, track in bare.items():
        assert track.T_sensor_object is None
        for scan, same in zip(track.scans, with_poses[name].scans, strict=True):
            np.testing.assert_array_equal(scan, same)


def test_missing_files_are_named(sequence):
    for name, cure in {
        "calib.txt": "odometry's calibration",
        "poses.txt": "SemanticKITTI's",
    }.items():
        kept = (sequence / name).read_bytes()
        (sequence / name).unlink()
        refused(sequence, f"{name}: no such file; .*{cure} ")
        (sequence / name).write_bytes(kept)
    refused(sequence, "none of the sequences 00 has a folder other; .* --labels", labels="other")
    (sequence / "velodyne").rename(sequence / "away")
    refused(sequence, r"velodyne: no such folder; .*data_odometry_velodyne\.zip")
    (sequence / "away").rename(sequence / "velodyne")
    (sequence / "empty").mkdir()
    refused(sequence, r"empty: no \.label files", labels="empty")
    refused(sequence, "'tank' is no category", selection=Selection(categories=("tank",)))


def test_damaged_poses_and_calibration_are_named(sequence):
    poses = (sequence / "poses.txt").read_text()
    (sequence / "poses.txt").write_text("".join(poses.splitlines(keepends=True)[:-1]))
    refused(sequence, r"poses\.txt: 5 poses, but there is a frame 5")
    (sequence / "poses.txt").write_text(poses[:-20])
    refused(sequence, r"poses\.txt, line 6: 11 numbers, expected 12")
    (sequence / "poses.txt").write_text(poses.replace("e-", "q-"))
    refused(sequence, r"poses\.txt, line 1: expected numbers")
    (sequence / "poses.txt").write_text(poses)
    (sequence / "calib.txt").write_text("P0: 1 2 3\n")
    refused(sequence, r"calib\.txt: found P0, expected a line Tr")
    (sequence / "calib.txt").write_text("Tr: " + "1 " * 12)
    refused(sequence, r"calib\.txt: Tr: a pose is no rotation")
    write_calibration(sequence)
    assert len(tracks(sequence)) == 2


def test_damaged_scans_and_labels_are_named(sequence, scene):
    scan, label = sequence / "velodyne" / "000003.bin", sequence / "labels" / "000003.label"
    good = scan.read_bytes(), label.read_bytes()
    scan.write_bytes(good[0][:-6])
    passed_over(SemanticKitti(sequence), r"000003\.bin: \d+ bytes, expected a multiple of 16")
    scan.write_bytes(good[0][:-16])
    passed_over(
        SemanticKitti(sequence), r"000003\.bin: \d+ points, but .*000003\.label has \d+ labels"
    )
    scan.write_bytes(good[0])
    label.write_bytes(good[1][:-1])
    refused(sequence, r"000003\.label: \d+ bytes, expected a multiple of 4")
    write_frame(sequence, 3, np.zeros((4, 3)), np.array([10, 40, 7, 7]))
    refused(sequence, r"000003\.label: class 7 is none of SemanticKITTI's")
