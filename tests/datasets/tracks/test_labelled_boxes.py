# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points inside labelled boxes."""

import warnings

import numpy as np
import pytest
import torch
from tests.refusal import refused

from wildshape.datasets.tracks.gathering import Gathering
from wildshape.datasets.tracks.labelled_boxes import (
    Crop,
    LabelledObject,
    check_boxes,
    crop_objects,
    rows_in_box,
)
from wildshape.datasets.tracks.selection import Selection
from wildshape.geometry.transforms.se3 import SE3
from wildshape.records import Sensor


def test_points_inside_are_found_as_by_the_definition() -> None:
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-4.0, 4.0, (5000, 3)).astype(np.float32)
    yaw = 0.7
    R = [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    T = SE3(torch.tensor(R), torch.tensor([0.5, -0.3, 0.2], dtype=torch.float64))
    size, crop = (3.0, 1.6, 1.4), Crop(0.1, -0.5)
    local = (cloud - T.translation.numpy()) @ np.asarray(R)
    half = np.asarray(size) / 2
    inside = (np.abs(local[:, :2]) <= half[:2] + crop.margin).all(axis=1)
    inside &= (local[:, 2] <= half[2] + crop.margin) & (local[:, 2] >= -half[2] + crop.ground)
    assert inside.sum() > 50
    assert rows_in_box(cloud, T, size, crop).tolist() == np.flatnonzero(inside).tolist()


def test_a_damaged_height_is_outside_without_a_word() -> None:
    cloud = np.array([[0, 0, np.inf], [0, 0, np.nan], [0, 0, -3e38], [0, 0, 0.2]], np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        rows = rows_in_box(cloud, SE3.identity(), (2.0, 2.0, 2.0), Crop())
    assert rows.tolist() == [3]


def test_an_object_that_is_labelled_twice_in_a_frame_gives_one_scan() -> None:
    cloud = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 3)).astype(np.float32)
    box = LabelledObject("car", 1, "car", "", (2.0, 2.0, 2.0), SE3.identity(), None)
    gathering = Gathering(Selection(min_points=1), Sensor("lidar"), {})
    for frame, boxes in (("0", (box, box)), ("1", (box,))):
        crop_objects(boxes, frame, lambda: cloud, Crop(), gathering)
    (track,) = gathering.finished()
    assert track.scan_names == ("0", "1")
    assert gathering.rejected == {"scan: a second box of the object in one frame": 1}


def box_of(length=4.0, x=1e7):
    """Sizes and poses of two boxes, the second as told."""
    poses = SE3(torch.eye(3).double().repeat(2, 1, 1), torch.zeros(2, 3).double())
    poses.translation[1, 0] = x
    return np.array([[4.0, 2.0, 1.5], [length, 2.0, 1.5]]), poses


@pytest.mark.parametrize(
    "wrong",
    [{"length": v} for v in (0.0, -4.0, 1001.0, np.nan)]
    + [{"x": v} for v in (1e9, np.inf, np.nan)],
)
def test_boxes_that_no_object_can_have_are_refused(wrong):
    check_boxes(*box_of(), "labels.csv", "copy it again")
    refused(
        check_boxes,
        *box_of(**wrong),
        "labels.csv",
        "copy it again",
        match=r"^labels\.csv: box 1 has no size or place .*; copy it again\.$",
    )
