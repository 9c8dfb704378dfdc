# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What counts and what does not, on drives of a few boxes."""

from pathlib import Path

import numpy as np
import pytest
import torch

from wildshape.errors import BadInputError
from wildshape.evaluation.drives.found import Found, FoundDrive
from wildshape.evaluation.drives.labels import (
    Counting,
    Label,
    LabelledDrive,
    LabelledFrame,
    View,
)
from wildshape.evaluation.drives.overlap import UprightBox
from wildshape.evaluation.drives.protocol import DriveScores, evaluate_drives
from wildshape.evaluation.drives.results import as_json, markdown
from wildshape.geometry.footprint import footprint
from wildshape.geometry.transforms.se3 import SE3

CAR = UprightBox(15.0, 2.0, -0.9, 4.0, 1.8, 1.5, 0.1)
FAR = CAR._replace(x=30.0)
NOWHERE = np.empty((0, 4))
# A camera at the LiDAR that looks along x: u = 600 - 700 y / x, v = 180 - 700 z / x.
AHEAD = np.array(((600, -700, 0, 0), (180, 0, -700, 0), (1, 0, 0, 0.0)))


def _label(box: UprightBox, track: int = 0, *, vehicle: bool = True, counted: bool = True) -> Label:
    return Label(track, vehicle, box, counted)


def _evaluated(
    found: list[list[UprightBox]],
    labels: list[list[Label]],
    *,
    view: View | None = None,
    regions: np.ndarray = NOWHERE,
) -> DriveScores:
    """Of boxes as sure as their track is early; track i is the i-th box of each frame."""
    frames = tuple(
        tuple(Found(f"{i}", 0.9 - 0.1 * i, box) for i, box in enumerate(boxes)) for boxes in found
    )
    labelled = tuple(LabelledFrame(tuple(row), regions) for row in labels)
    truth = LabelledDrive(Path("labels"), labelled, (), view, None, Counting())
    return evaluate_drives([FoundDrive(Path("none"), frames, None)], [truth])


def _precisions(scores: DriveScores) -> list[float | None]:
    return [one.average_precision for one in scores.rows[0].detections]


def test_nothing_is_no_negative_bias() -> None:
    slightly_short = CAR._replace(length=CAR.length - 0.001)
    table = markdown(_evaluated([[slightly_short]], [[_label(CAR)]]), Counting())
    assert "+0.00 +0.00 +0.00" in table


def test_what_is_right_is_right_everywhere() -> None:
    scores = _evaluated([[CAR, FAR]] * 3, [[_label(CAR, 4), _label(FAR, 9)]] * 3)
    row = scores.rows[0]
    assert _precisions(scores) == [1, 1, 1, 1]
    assert (row.labels, row.boxes, row.identity_switches) == (6, 6, 0)
    assert row.size_bias_m == (0, 0, 0)
    assert row.hota is not None
    assert row.hota.hota == pytest.approx(1)
    assert [(v.track, v.scans, v.found, v.tracks) for v in row.vehicles] == [
        (4, 3, 3, ("0",)),
        (9, 3, 3, ("1",)),
    ]


def test_boxes_that_are_off() -> None:
    """Shifted along by 1 m of 4: IoU 3/5 in bird's eye view; half as high, too: 3/8 of space."""
    off = CAR._replace(x=CAR.x + np.cos(0.1), y=CAR.y + np.sin(0.1))
    scores = _evaluated([[off]], [[_label(CAR)]])
    assert _precisions(scores) == [1, 0, 1, 0]
    assert scores.rows[0].vehicles[0].found == 1
    low = off._replace(height=0.75, z=CAR.z - 0.375)
    scores = _evaluated([[low]], [[_label(CAR)]])
    assert _precisions(scores) == [1, 0, 0, 0]
    assert scores.rows[0].size_bias_m == pytest.approx((0, 0, -0.75))


def test_what_nobody_labelled_is_a_mistake() -> None:
    scores = _evaluated([[CAR, FAR]], [[_label(FAR)]])
    assert _precisions(scores)[0] == pytest.approx(1 / 2)
    assert scores.rows[0].boxes == 2


@pytest.mark.parametrize("vehicle", [True, False])
def test_labels_that_do_not_count_are_neither_found_nor_missed(vehicle: bool) -> None:
    few = _label(CAR, 1, vehicle=vehicle, counted=False)
    scores = _evaluated([[CAR, FAR]], [[few, _label(FAR)]])
    assert _precisions(scores) == [1, 1, 1, 1]
    assert (scores.rows[0].labels, scores.rows[0].boxes) == (1, 1)
    assert _precisions(_evaluated([[FAR]], [[few, _label(FAR)]]))[0] == 1


def test_a_poor_box_on_what_does_not_count_is_no_mistake() -> None:
    few = _label(CAR, 1, counted=False)
    part = CAR._replace(length=1.0, width=1.0)
    assert _precisions(_evaluated([[part, FAR]], [[few, _label(FAR)]]))[0] == 1
    beside = CAR._replace(y=CAR.y + 1.2)
    assert _precisions(_evaluated([[beside, FAR]], [[few, _label(FAR)]]))[0] == pytest.approx(0.5)


@pytest.mark.parametrize(
    "unseen",
    [
        CAR._replace(x=-15.0),
        CAR._replace(x=15.0, y=20.0),
        CAR._replace(x=70.0),
    ],
    ids=["behind", "beside", "far"],
)
def test_boxes_that_the_labelled_camera_does_not_see(unseen: UprightBox) -> None:
    view = View(AHEAD, Counting())
    assert not view.sees(unseen)
    scores = _evaluated([[unseen, FAR]], [[_label(FAR)]], view=view)
    assert _precisions(scores)[0] == 1
    assert _precisions(_evaluated([[unseen, FAR]], [[_label(FAR)]]))[0] == pytest.approx(0.5)


def test_the_table_says_where_only_a_camera_s_view_counts() -> None:
    for view, drives in ((View(AHEAD, Counting()), 1), (None, 0)):
        scores = _evaluated([[FAR]], [[_label(FAR)]], view=view)
        assert as_json(scores, Counting(), {})["cameras"] == drives
        told = "only what the camera sees within 60 m counts: 1" in markdown(scores, Counting())
        assert told == bool(drives)


def test_the_picture_of_a_turned_box_holds_its_corners() -> None:
    """Cut at the edge; none of a box that reaches behind the camera."""
    box = CAR._replace(yaw=0.7)
    corners = footprint(np.array((*box[:3], box.yaw)), box[3:5])
    u = 600 - 700 * corners[:, 1] / corners[:, 0]
    v = [180 - 700 * (box.z + up * box.height / 2) / corners[:, 0] for up in (-1, 1)]
    view = View(AHEAD, Counting())
    assert view.picture(box) == pytest.approx((u.min(), np.min(v), u.max(), np.max(v)))
    left, top, right, bottom = view.picture(box._replace(x=4.0, y=3.0)) or (1, 1, 1, 1)
    assert (left, top < 375, right < 600, bottom) == (0, True, True, 375)
    assert view.picture(box._replace(x=1.0)) is None


def test_boxes_in_regions_that_nobody_cared_to_label() -> None:
    view = View(AHEAD, Counting())
    left, top, right, bottom = view.picture(CAR) or (0, 0, 0, 0)
    wide, tall = (right - left) / 3, (bottom - top) / 3
    thirds = (
        (left, top, left + wide, bottom),
        (right - wide, top, right, bottom),
        (left, top, right, top + tall),
        (left, bottom - tall, right, bottom),
    )
    beside = ((right, top, 2 * right - left, bottom), (left, bottom, right, 2 * bottom - top))
    whole, apart = (left, top, right, bottom), [(one, 0.5) for one in (*thirds, *beside)]
    for region, expected in ((whole, 1), *apart, (None, 0.5)):
        regions = NOWHERE if region is None else np.array([region])
        scores = _evaluated([[CAR, FAR]], [[_label(FAR)]], view=view, regions=regions)
        assert _precisions(scores)[0] == pytest.approx(expected)


def test_drives_are_measured_as_one_and_their_tracks_apart() -> None:
    frames = tuple((Found("0", 0.9, CAR),) for _ in range(2))
    labelled = tuple(LabelledFrame((_label(CAR, 0),), NOWHERE) for _ in range(2))
    truth = LabelledDrive(Path("labels"), labelled, (), None, None, Counting())
    found = FoundDrive(Path("none"), frames, None)
    missed = FoundDrive(Path("none"), ((), ()), None)
    row = evaluate_drives([found, missed], [truth, truth]).rows[0]
    assert row.detections[0].average_precision == pytest.approx(0.5)
    assert (row.purity.vehicles, row.purity.vehicles_found) == (2, 1)
    assert [v.drive for v in row.vehicles] == [0, 1]


def test_trajectories_drift_in_percent_of_the_labelled_way() -> None:
    """10 m too far at the end of 10 m."""
    eye = torch.eye(3, dtype=torch.float64).expand(2, 3, 3)
    places = torch.tensor([[0.0, 0, 0], [10, 0, 0]], dtype=torch.float64)
    labelled = tuple(LabelledFrame((_label(CAR),), NOWHERE) for _ in range(2))
    truth = LabelledDrive(Path("labels"), labelled, (), None, SE3(eye, places), Counting())
    found = FoundDrive(Path("none"), ((), ()), SE3(eye, 2 * places))
    (error,) = evaluate_drives([found], [truth]).trajectories
    assert error is not None
    assert error.way_m == 10
    assert error.drift_percent == pytest.approx(100)


def test_nothing_counts() -> None:
    with pytest.raises(BadInputError, match="no label counts"):
        _evaluated([[CAR]], [[_label(CAR, counted=False)]])
