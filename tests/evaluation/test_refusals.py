# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Methods that refuse some scans of a track, or answer of fewer than they took."""

from collections import Counter

import numpy as np
import pytest
import torch
from tests.cars import drive_by, known

from wildshape.baselines.identity import OneScan
from wildshape.errors import BadInputError
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.summary import figures_of
from wildshape.geometry.transforms.se3 import SE3


class PickyTrack(OneScan):
    """Knows poses and shape of a track of which it is shown two scans or more, not all."""

    def __init__(self, track, refused):
        self.track, self.refused = track, refused

    def complete_many(self, scans, sensor):
        known = [self._number(scan) for scan in scans]
        if not {*known}.isdisjoint(self.refused):
            raise BadInputError("too wide.")
        alone = len(scans) == 1
        return [Spoken(scans[0] if alone else self._shape(i)) for i in known]

    def register_track(self, scans, sensor):
        done = [self._number(scan) for scan in scans if self.complete_many(scans, sensor)]
        poses = self.track.T_sensor_object
        return poses[done[len(done) // 2]] @ poses[torch.tensor(done)].inverse()

    def _number(self, points):
        return next(i for i, s in enumerate(self.track.scans) if np.array_equal(s, points))

    def _shape(self, i):
        return self.track.T_sensor_object[i].apply_numpy(self.track.shape)


@pytest.mark.parametrize(
    ("refused", "middle"), [((0, 1), 2), ((2,), 3), ((4,), 2)], ids=["before", "middle", "after"]
)
def test_of_a_track_the_refused_scans_alone_are_lost(refused, middle):
    track = drive_by(scans=5)
    row = run({"track": PickyTrack(track, refused)}, [track])["track"]
    kept = [f"{i:06d}" for i in range(5) if i not in refused]
    assert [one.scan for one in row.completions] == kept
    assert [one.scan for one in row.registrations] == [name for name in kept if int(name) != middle]
    figures = known(figures_of(row))
    assert figures["cd"] < 1e-5
    assert figures["trans_median_m"] < 1e-9
    assert Counter(one.reason for one in row.skipped) == {
        "completion: refused by the method": len(refused),
        "registration: refused by the method": len(refused),
    }


class Forgetful(OneScan):
    """Answers of some scans only, or of one scan twice."""

    def __init__(self, shapes, poses):
        self.shapes, self.poses = shapes, poses

    def complete_many(self, scans, sensor):
        return [Spoken(scan) for scan in (*scans, *scans)[: self.shapes]]

    def register_track(self, scans, sensor):
        return SE3.identity(self.poses)


@pytest.mark.parametrize(("shapes", "poses"), [(3, 4), (5, 4), (4, 2), (4, 5)])
def test_a_method_that_forgets_scans_is_told(shapes, poses):
    with pytest.raises(BadInputError, match=r"drive: the method answers [235] times for 4 scans"):
        run({"forgetful": Forgetful(shapes, poses)}, [drive_by(scans=4, points=30)])
