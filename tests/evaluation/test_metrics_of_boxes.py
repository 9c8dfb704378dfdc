# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Boxes against the true one: overlap by hand, headings raw and by symmetry, columns of a table."""

import json
import math

import numpy as np
import pytest
import torch
from tests.cars import drive_by, poses_of

from wildshape.evaluation.metrics import (
    BoxScore,
    CompletionError,
    box_score,
    labelled_box,
    true_box,
)
from wildshape.evaluation.protocol import Spoken, run
from wildshape.evaluation.results import CompletionScore, MethodScores
from wildshape.evaluation.summary import figures_of, write_metrics
from wildshape.evaluation.tables import markdown
from wildshape.geometry.box import FittedBox
from wildshape.geometry.transforms.rotation import (
    quaternion_from_rotation,
    random_rotation,
    rotation_z,
)
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.boxes import carried
from wildshape.records import Box
from wildshape.simulate.raycast import Scene
from wildshape.simulate.shapes.solid import box, ellipsoid, union
from wildshape.simulate.truth import visible_surface

SHAPE = np.array([[x, y, z] for x in (-2, 2) for y in (-1, 1) for z in (0, 1)], np.float32)
TRUTH = true_box(SHAPE)


def turned(degrees):
    return rotation_z(torch.tensor(math.radians(degrees), dtype=torch.float64))


def placed(seed=0):
    turn = random_rotation(1, torch.Generator().manual_seed(seed))[0].double()
    return SE3(turn, torch.tensor((9.0, -4.0, 1.0), dtype=torch.float64))


def test_the_box_of_a_shape_holds_it_tightly():
    assert TRUTH.centre.tolist() == [0, 0, 0.5]
    assert TRUTH.size.tolist() == [4, 2, 1]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("shift", "degrees", "iou", "heading"),
    [
        ((0.0, 0.0, 0.0), 0.0, 1.0, 0.0),
        ((2.0, 0.0, 0.0), 0.0, 1 / 3, 0.0),
        ((0.0, 0.0, 0.0), 180.0, 1.0, 180.0),
        ((0.0, 0.0, 0.0), 90.0, 1 / 3, 90.0),
        ((0.0, 0.0, 2.0), -20.0, 0.0, 20.0),
    ],
)
def test_scores_by_hand_wherever_the_object_is(seed, shift, degrees, iou, heading):
    moved = FittedBox(TRUTH.centre + torch.tensor(shift), TRUTH.size, turned(degrees))
    pose = placed(seed)
    score = box_score(carried(moved, pose), TRUTH, pose)
    assert score.iou == pytest.approx(iou, abs=1e-4)
    assert score.heading_deg == pytest.approx(heading, abs=1e-3)


def test_the_true_box_of_a_vehicle_is_that_of_its_body():
    car = box((-2.0, -0.9, 0.0), (2.0, 0.9, 1.5))
    mirrors = [ellipsoid((0.6, side * 0.98, 1.0), (0.07, 0.11, 0.08)) for side in (-1, 1)]
    whole = union([car, *mirrors])
    shape = visible_surface(whole, Scene([whole]), 8192, 0.0, np.random.default_rng(0))
    assert true_box(shape).size[1] > 2.1
    torch.testing.assert_close(
        true_box(shape, body=True).size, torch.tensor((4.0, 1.8, 1.5)).double(), atol=0.02, rtol=0
    )


def scored(box):
    error = CompletionError(0.1, 0.1)
    return CompletionScore("a", "0", error, None, "shape", 1, 1, 0.05, box=box)


def test_one_end_is_the_front_for_the_whole_row():
    found = [scored(BoxScore(0.8, off)) for off in (178.0, 175.0, 10.0, 95.0)]
    figures = figures_of(MethodScores("m", tuple(found), (), ()))
    assert figures["box_iou"] == pytest.approx(0.8)
    assert figures["heading30"] == 0.5
    assert figures["heading30_sym"] == 0.75
    assert figures["heading_sym_median_deg"] == pytest.approx((5 + 10) / 2)
    bare = figures_of(MethodScores("m", (scored(None),), (), ()))
    assert all(bare[name] is None for name in ("box_iou", "heading30", "heading30_sym"))


class Boxing:
    """Completes with the scan, and knows the box but for a shift of one scan."""

    def __init__(self, track, shift=0.0):
        assert track.shape is not None
        self.poses, self.box = poses_of(track), true_box(track.shape, body=True)
        self.shift = torch.tensor((shift, 0.0, 0.0), dtype=torch.float64)

    def complete(self, points, sensor):
        return points

    def complete_many(self, scans, sensor):
        moved = self.box._replace(centre=self.box.centre + self.shift)
        boxes = [carried(moved, self.poses[i]) for i in range(len(scans))]
        return [Spoken(scan, 0.5, box) for scan, box in zip(scans, boxes, strict=True)]


class Silent:
    """Draws no box."""

    def complete(self, points, sensor):
        return points


def test_an_evaluation_has_columns_where_a_method_draws_boxes(tmp_path):
    track = drive_by(scans=3, points=60)
    methods = {"exact": Boxing(track), "off": Boxing(track, shift=1.0), "silent": Silent()}
    results = run(methods, [track])
    assert figures_of(results["exact"])["box_iou"] == pytest.approx(1, abs=1e-4)
    length = float(Boxing(track).box.size[0])
    expected = (length - 1) / (length + 1)
    assert figures_of(results["off"])["box_iou"] == pytest.approx(expected, abs=1e-4)
    assert figures_of(results["exact"])["heading30"] == 1
    assert figures_of(results["silent"])["box_iou"] is None
    found = json.loads(write_metrics(tmp_path, [results]).read_text("utf-8"))
    assert found["methods"]["exact"]["heading30_sym"] == 1
    assert "box IoU" in markdown([results])
    assert "box IoU" not in markdown([run({"silent": Silent()}, [track])])


def test_boxes_are_held_against_the_label_where_there_is_one():
    """Shape and scans are of a car of another size; each axis is told on its own."""
    truth = labelled_box((4.0, 2.0, 1.5))
    T = SE3(rotation_z(torch.tensor(0.7).double()), torch.tensor([9.0, 4.0, 0.3]).double())
    w, x, y, z = quaternion_from_rotation(T.rotation).tolist()
    px, py, pz = T.translation.tolist()
    score = box_score(Box((px, py, pz), (4.4, 1.9, 1.5), (w, x, y, z)), truth, T)
    assert score.bev == pytest.approx(4.0 * 1.9 / (4.4 * 1.9 + 4.0 * 0.1))
    assert score.iou == pytest.approx(score.bev)
    off = (score.length_off_m, score.width_off_m, score.height_off_m)
    assert off == pytest.approx((0.4, -0.1, 0.0))


def test_a_box_beside_the_true_one_is_turned_as_it_lies():
    """Along the diagonal of a square, out of its corner; across it little would be shared."""
    square = FittedBox(
        torch.zeros(3).double(), torch.tensor((2.0, 2.0, 1.0)).double(), torch.eye(3).double()
    )
    half = math.radians(45) / 2
    along = Box((1.0, 1.0, 0.0), (4.0, 0.4, 1.0), (math.cos(half), 0.0, 0.0, math.sin(half)))
    score = box_score(along, square, SE3.identity())
    shared = 2 * 0.4 - 0.4**2 / 4
    assert score.bev == pytest.approx(shared / (4 + 4 * 0.4 - shared))
    assert score.iou == pytest.approx(score.bev)
