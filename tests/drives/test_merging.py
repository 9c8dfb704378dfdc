# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which objects share a place, across breaks of the sensor's way and in long drives."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from tests.drives.cuts import write_cut
from tests.drives.objects import completed, still
from tests.models import CONFIG, SETTINGS

from wildshape.drives.clock import Clock, silent
from wildshape.drives.completing import merging
from wildshape.drives.completing.cluster_association import associate, in_box
from wildshape.drives.completing.merging import Places
from wildshape.drives.config import BoxConfig, DriveConfig, MergeConfig
from wildshape.drives.pipeline import Pipeline
from wildshape.drives.source import Drive
from wildshape.drives.tracking.sightings import Sightings
from wildshape.drives.tracking.trajectory import Breaks
from wildshape.inference.predictor import Predictor
from wildshape.io.atomic import write_json
from wildshape.method.network import ShapePoseNet
from wildshape.parallel.team import ALONE
from wildshape.records import Turn

HERE = (0.0, 0.0, 0.0, 0.0)


def places(count, breaks=()):
    return Places(still(count, breaks), MergeConfig(), BoxConfig())


def driving(frames, name):
    return completed([(frame, 0.0, 0.0, 0.0) for frame in frames], frames, name)


@pytest.mark.parametrize("kind", ["standing", "moving"])
def test_no_two_objects_are_one_across_a_break(kind):
    if kind == "standing":
        objects = [completed([HERE], (at,), str(at)) for at in (2, 60)]
    else:
        objects = [driving((0, 4, 8, 12), "0"), driving((20, 24, 28), "1")]
    (found,) = places(100).fragments(objects)
    assert found.name.endswith("+1")
    (found,) = places(100, (16 + 80,)).fragments(objects)  # behind both
    assert places(100, (16,)).fragments(objects) == []
    assert places(100, (16,)).overlap(*objects) == -1.0


def test_no_vehicle_claims_clusters_across_a_break(tmp_path):
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 3))
    for frame in range(6):
        write_cut(tmp_path, frame, [points], 20)
    one = replace(completed([HERE]), seen=Sightings("a", (3,), ((0,),), (20,)))
    for breaks, frames in (((), range(6)), ((2, 5), range(2, 5)), ((3,), range(3, 6))):
        (found,) = associate([one], tmp_path, still(6, breaks), DriveConfig()).vehicles
        assert found.seen.frames == tuple(frames)


def test_a_drive_tells_its_breaks_to_what_follows(tmp_path):
    names = [f"{frame:06d}" for frame in range(4)]
    seen = Turn(np.zeros((1, 3), np.float32), np.zeros(1))
    drive = Drive.of("drive", names, lambda _: seen, [0.0, 0.1, 0.2, 0.3])
    write_json(tmp_path / "stages" / "breaks.json", asdict(Breaks((2,))))
    predictor = Predictor(ShapePoseNet(CONFIG).eval(), SETTINGS)
    running = Pipeline(drive, tmp_path, DriveConfig(), predictor, ALONE, None, Clock(silent))
    assert running.turns([], still(4).T_level_sensor).unbroken(2, 2) == range(2, 4)


def test_those_that_stand_are_compared_once_and_only_where_they_may_touch(monkeypatch):
    compared, compare = [], merging.footprint_overlap
    monkeypatch.setattr(
        merging, "footprint_overlap", lambda *pair: compared.append(pair) or compare(*pair)
    )
    one, near, far = (completed([(x, 0.0, 0.0, 0.0)], name=str(x)) for x in (0.0, 1.0, 5.0))
    there = places(500)
    assert there.overlap(one, near) == pytest.approx(3 / 4, abs=0.01)
    assert len(compared) == 1
    assert there.overlap(one, far) == 0.0
    assert len(compared) == 1


def test_two_share_a_place_if_they_do_around_their_completed_scans():
    """Ways that lead apart before and after; one vehicle seen badly twice."""
    frames = tuple(range(10, 15))
    one, other = (
        completed([(f, 0.1 * side * (f - 12), 0.0, 0.0) for f in frames], frames, name=str(side))
        for side in (-1, 1)
    )
    assert places(30).share(one, other)


def test_points_just_around_a_box_belong_to_it():
    box, size = np.array((0.0, 0.0, 0.0, np.pi / 2)), (4.0, 2.0, 1.5)
    ends = np.diag((1.0, 2.0, 0.75)).astype(np.float32)  # its length lies along y
    for sign in (1, -1):
        assert in_box(sign * (ends + 0.15 * np.eye(3, dtype=np.float32)), box, size, 0.2).all()
        assert not in_box(sign * (ends + 0.25 * np.eye(3, dtype=np.float32)), box, size, 0.2).any()
