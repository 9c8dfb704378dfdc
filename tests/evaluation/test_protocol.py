# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys
from collections import Counter
from dataclasses import fields, make_dataclass, replace

import numpy as np
import pytest
from tests.cars import drive_by, known, poses_of, shape_of
from tests.refusal import refused

from wildshape.baselines.icp import LocalIcp
from wildshape.baselines.identity import Identity, OneScan
from wildshape.baselines.pairs import Chained
from wildshape.datasets.tracks.truth import TruthBuilder
from wildshape.errors import BadInputError
from wildshape.evaluation import protocol
from wildshape.evaluation.cases import turn_track
from wildshape.evaluation.metrics import RegistrationError, registration_error
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.results import Limits, Skipped
from wildshape.evaluation.summary import figures_of
from wildshape.records import Sensor, SightLines

LOCAL_ICP = Chained(LocalIcp())


class Spoiling(OneScan):
    """Returns what it was given, and spoils that."""

    def complete(self, points, sensor):
        answer = super().complete(points, sensor).copy()
        points[:] = np.nan
        return answer


@pytest.mark.parametrize("rotate", ["none", "so3"])
def test_a_method_that_spoils_its_input_harms_nothing(rotate):
    track = drive_by(scans=3, points=120)
    before = [scan.copy() for scan in track.scans]
    made = run({"spoils": Spoiling(), "does not": OneScan()}, [track], rotate, seed=4)
    assert all(np.array_equal(a, b) for a, b in zip(track.scans, before))
    expected = figures_of(made["does not"])["cd"]
    assert expected is not None
    assert expected > 0
    assert figures_of(made["spoils"])["cd"] == expected


def test_turning_moves_scans_and_truth_alike():
    track = drive_by(scans=6)
    for rotate in ("yaw", "so3"):
        turned = turn_track(track, rotate, seed=1)
        before = poses_of(track).inverse()
        after = poses_of(turned).inverse()
        for i, (a, b) in enumerate(zip(track.scans, turned.scans)):
            assert not np.allclose(a, b, atol=0.1)
            # About the sensor's origin: the ranges stay.
            assert np.linalg.norm(a, axis=1) == pytest.approx(np.linalg.norm(b, axis=1), rel=1e-5)
            assert before[i].apply_numpy(a) == pytest.approx(after[i].apply_numpy(b), abs=1e-4)
    assert turn_track(track, "none", seed=1) is track


def test_yaw_turns_about_the_sensors_vertical():
    track = drive_by(scans=3)
    lidar = turn_track(track, "yaw", seed=0)
    camera = turn_track(replace(track, sensor=Sensor(kind="camera")), "yaw", seed=0)
    for a, b, c in zip(track.scans, lidar.scans, camera.scans):
        assert b[:, 2] == pytest.approx(a[:, 2], abs=1e-5)
        assert c[:, 1] == pytest.approx(a[:, 1], abs=1e-5)
        assert not np.allclose(c[:, 2], a[:, 2], atol=0.1)


def test_turns_depend_on_seed_and_name_only():
    a, b = drive_by("a", scans=3), drive_by("b", scans=3)
    again = turn_track(a, "so3", seed=2).scans
    assert np.array_equal(turn_track(a, "so3", seed=2).scans[1], again[1])
    assert not np.allclose(turn_track(a, "so3", seed=3).scans[1], again[1], atol=0.1)
    other = turn_track(replace(b, scans=a.scans), "so3", seed=2).scans
    assert not np.allclose(other[1], again[1], atol=0.1)


def test_identity_is_right_on_a_straight_road_and_by_chance_under_yaw():
    tracks = [drive_by(f"t{seed}", scans=9, points=60, seed=seed) for seed in range(20)]
    # Only poses are looked at here: any small cloud will do for a shape.
    tracks = [replace(t, shape=t.scans[0]) for t in tracks]
    recorded = known(figures_of(run({"identity": Identity()}, tracks)["identity"]))
    assert recorded["acc30"] == 1
    assert recorded["rot_median_deg"] < 1e-5
    turned = known(figures_of(run({"identity": Identity()}, tracks, "yaw", seed=0)["identity"]))
    # 60 of 360 degrees: 16.7 %, three standard deviations of 160 draws either side.
    assert turned["acc30"] == pytest.approx(1 / 6, abs=0.09)
    assert turned["acc30_sym"] == pytest.approx(1 / 3, abs=0.12)


def test_local_icp_row_beats_identity_by_cd_where_the_track_is_easy():
    tracks = [drive_by(f"t{seed}", step=0.5, seed=seed) for seed in range(2)]
    methods = {"identity": Identity(), "icp": LOCAL_ICP, "scan": OneScan()}
    results = run(methods, tracks)
    figures = {name: known(figures_of(results[name])) for name in methods}
    assert figures["icp"]["rot_median_deg"] < 5
    assert figures["icp"]["trans_median_m"] < figures["identity"]["trans_median_m"]
    assert "acc30" not in figures["scan"]
    assert figures["scan"]["points"] < figures["icp"]["points"]
    assert len(results["scan"].completions) == 2 * 11
    assert len(results["icp"].completions) == 2
    # Every scan but the middle one.
    assert len(results["icp"].registrations) == 2 * 10


class Oracle:
    """Knows the truth of a test's track."""

    def __init__(self, track):
        self.track = track

    def complete(self, points, sensor):
        i = next(i for i, s in enumerate(self.track.scans) if np.array_equal(s, points))
        return self.track.T_sensor_object[i].apply_numpy(self.track.shape)

    def register_track(self, scans, sensor):
        poses = self.track.T_sensor_object
        return poses[self.track.middle] @ poses.inverse()

    def complete_track(self, scans, sensor):
        return self.complete(scans[len(scans) // 2], sensor)


def test_a_perfect_method_has_no_error_and_two_rows():
    track = drive_by(scans=4)
    results = run({"oracle": Oracle(track)}, [track])
    assert [scores.name for scores in results.methods] == ["oracle", "oracle, whole track"]
    figures = known(figures_of(results["oracle"]))
    assert figures["cd"] < 1e-5
    assert figures["acc30"] == 1
    assert figures["trans_median_m"] < 1e-9
    assert known(figures_of(results["oracle, whole track"]))["cd"] < 1e-5


class Canonical:
    """Knows the true shape, and says nothing of where it is."""

    def __init__(self, shape):
        self.shape = shape

    def complete_canonical(self, scans, sensor):
        return [self.shape for _ in scans]


@pytest.mark.parametrize("rotate", ["none", "so3"])
def test_shapes_in_the_objects_frame_are_measured_there_however_scans_are_turned(rotate):
    track = drive_by(scans=4)
    shape = np.asarray(track.shape)
    moved = shape + np.array((0, 0, 5), np.float32)
    methods = {"right": Canonical(shape), "moved": Canonical(moved)}
    results = run(methods, [track, replace(track, name="bare", T_sensor_object=None)], rotate)
    assert known(figures_of(results["right"]))["cd"] < 1e-6
    assert known(figures_of(results["moved"]))["cd"] > 5
    assert not results["right"].registrations
    assert {one.track for one in results["right"].skipped} == {"bare"}


class PickyCanonical:
    def __init__(self, shape):
        self.shape = shape

    def complete_canonical(self, scans, sensor):
        for scan in scans:
            if len(scan) == 30:
                raise BadInputError("thirty points are too few.")
            yield self.shape


class PickySighted(OneScan):
    """Looks at rays, and refuses by the number of points."""

    def complete_sighted(self, scans, sensor, rays):
        for scan, seen in zip(scans, rays):
            if len(scan) == 30:
                raise BadInputError("thirty points are too few.")
            yield Spoken(seen.ends.astype(np.float32))


def test_a_refused_scan_costs_no_other_its_shape_or_its_rays():
    track = drive_by(scans=4)
    shape = np.asarray(track.shape)
    scans = (track.scans[0][:30], *track.scans[1:])
    rays = tuple(SightLines.of_returns(pose.apply_numpy(shape)) for pose in poses_of(track))
    seen = replace(track, scans=scans, rays=rays)
    results = run({"canonical": PickyCanonical(shape), "sighted": PickySighted()}, [seen])
    for row in results.methods:
        assert [one.reason for one in row.skipped] == ["completion: refused by the method"]
        assert len(row.completions) == 3
        assert known(figures_of(row))["cd"] < 1e-5


class Picky(OneScan):
    """Refuses, or answers nonsense, by the number of points."""

    def complete(self, points, sensor):
        if len(points) == 30:
            raise BadInputError("thirty points are too few.")
        return points[:0] if len(points) == 40 else points

    def complete_many(self, scans, sensor):
        return (Spoken(self.complete(scan, sensor)) for scan in scans)


def test_what_is_left_out_is_counted_with_its_reason():
    track = drive_by(scans=8, points=100)
    scans = list(track.scans)
    scans[0] = scans[0][:15]
    scans[1] = np.repeat(scans[1][:1], 50, axis=0)
    scans[2] = np.concatenate((scans[2][:10], np.full((50, 3), np.nan, np.float32)))
    scans[3], scans[4] = scans[3][:30], scans[4][:40]
    track = replace(track, scans=tuple(scans))
    results = run({"picky": Picky()}, [track, replace(track, name="bare", T_sensor_object=None)])
    assert Counter(one.reason for one in results["picky"].skipped) == {
        "fewer than 16 finite points": 4,
        "all points equal": 2,
        "completion: refused by the method": 1,
        "completion: prediction empty or not finite": 1,
        "completion: no true poses": 5,
    }
    assert [row.scan for row in results["picky"].completions] == ["000005", "000006", "000007"]
    # Named, too.
    named = [one for one in results["picky"].skipped if one.track == "drive"]
    assert named == [
        Skipped("drive", "000000", "fewer than 16 finite points"),
        Skipped("drive", "000001", "all points equal"),
        Skipped("drive", "000002", "fewer than 16 finite points"),
        Skipped("drive", "000003", "completion: refused by the method"),
        Skipped("drive", "000004", "completion: prediction empty or not finite"),
    ]


@pytest.mark.parametrize("answered", [lambda p: p[:, :2], lambda p: p[None]])
def test_an_answer_that_is_no_cloud_is_told(answered):
    class Wrong:
        """Answers another shape than it should."""

        def complete(self, points, sensor):
            return answered(points)

    refused(run, {"wrong": Wrong()}, [drive_by(scans=3)], match=r"drive: .* must give \(m, 3\)")


def test_what_is_no_method_and_no_protocol_is_refused_before_anything_is_measured():
    program = (  # where no test checks types
        "import sys\n"
        "from wildshape.errors import BadInputError\n"
        "from wildshape.evaluation.protocol import run\n"
        "for methods, rotate in (({'mine': print}, 'yaw'), ({}, 'Yaw')):\n"
        "    try: run(methods, [], rotate)\n"
        "    except BadInputError as error: print(error)\n"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert found.stdout.splitlines() == [
        "mine: neither completes nor registers; `evaluation/method.py` says how.",
        "rotate 'Yaw' is unknown; use one of none, yaw, so3.",
    ]


def test_a_row_that_there_is_not_is_no_end_of_an_iteration():
    with pytest.raises(KeyError, match="nobody"):
        _ = run({}, [])["nobody"]


def test_truth_is_accumulated_where_no_shape_is_given():
    track = replace(drive_by(scans=7), shape=None)
    row = run({"scan": OneScan()}, [track], limits=Limits(max_scans=3))["scan"]
    assert [score.scan for score in row.completions] == ["000000", "000003", "000006"]
    score = row.completions[0]
    assert score.truth == "mirrored"
    assert score.error_partial is not None
    assert score.partial_points is not None
    assert score.partial_points < score.truth_points
    # The far side is not in the scan: more is missing of the mirrored truth.
    assert score.error.coverage > score.error_partial.coverage
    assert run({"scan": OneScan()}, [drive_by(scans=2)])["scan"].completions[0].truth == "shape"


def test_a_shape_of_few_points_is_measured_and_one_of_none_is_no_truth():
    track = drive_by(scans=2)
    three, none = (replace(track, shape=shape_of(track)[:count]) for count in (3, 0))
    scores = run({"scan": OneScan()}, [three])["scan"].completions
    assert [(score.truth_points, score.cd_floor) for score in scores] == [(3, 0.0)] * 2
    skipped = run({"scan": OneScan()}, [none])["scan"].skipped
    assert {one.reason for one in skipped} == {"completion: no true shape"}


@pytest.mark.parametrize("kind", ["partial", "mirrored"])
def test_a_shape_made_of_scans_counts_as_none_would(kind):
    bare = replace(drive_by(scans=7), shape=None)
    made = TruthBuilder(kind).with_shape(bare)
    assert made is not None
    found, wanted = (run({"scan": OneScan()}, [one])["scan"] for one in (made, bare))
    for one, other in zip(found.completions, wanted.completions, strict=True):
        assert one.truth == "mirrored"
        # Of the partial shape the reflection is that of its thinned points.
        assert one.error.cd == pytest.approx(other.error.cd, abs=2e-3)
        assert one.truth_points == pytest.approx(other.truth_points, rel=0.1)
        # What was seen is not to be told from its reflection.
        assert one.error_partial == (other.error_partial if kind == "partial" else None)


def test_progress_and_seed_are_told():
    told = []
    tracks = [drive_by(name, scans=2, points=30) for name in ("a", "b")]
    run({"scan": OneScan()}, iter(tracks), progress=lambda done, name: told.append((done, name)))
    assert told == [(1, "a"), (2, "b")]


def test_figures_of_a_registration_go_by_name_not_by_place(monkeypatch):
    tracks = [drive_by(scans=3, points=200)]
    figures = figures_of(run({"identity": Identity()}, tracks)["identity"])
    turned = make_dataclass("Turned", [one.name for one in reversed(fields(RegistrationError))])
    monkeypatch.setattr(
        protocol, "registration_error", lambda *poses: turned(**vars(registration_error(*poses)))
    )
    assert figures_of(run({"identity": Identity()}, tracks)["identity"]) == figures
