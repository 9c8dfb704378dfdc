# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Each reason speaks above its threshold and not below, alone and on a track."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest
from tests import models

from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.confidence import (
    judged,
    reasons_of_result,
    reasons_of_scan,
    reasons_of_track,
    warning_of,
)
from wildshape.inference.config import InferenceConfig, ReasonRule, TrackConfig
from wildshape.inference.predictor import load
from wildshape.inference.registration import registered
from wildshape.method.checkpoint import SHIPPED, load_checkpoint
from wildshape.records import Box, Completion, Sensor

SETTINGS = dataclasses.replace(models.SETTINGS, cost_m=(0.1, 0.2))


def line(length, count=64):
    """Points on a line: the diagonal of their bounding box is its length, metres."""
    x = np.linspace(8, 8 + length, count)
    return np.column_stack((x, np.zeros((count, 2)))).astype(np.float32)


def completion(cost, confidence):
    box = Box((8.0, 0.0, 0.0), (4.0, 2.0, 1.0), (1.0, 0.0, 0.0, 0.0))
    return Completion(line(4.0), SE3.identity(), box, confidence, branch=0, cost=cost)


@pytest.mark.parametrize(
    ("scan", "sensor", "expected"),
    [
        (line(5.9), None, ()),
        (line(6.1), None, ("too_large_for_model",)),
        (line(1.1), Sensor("lidar"), ()),
        (line(0.9), None, ("too_small_for_model",)),
        (line(4.0, 32), None, ()),
        (line(4.0, 31), None, ("few_points",)),
        (line(4.0), Sensor("camera"), ("other_sensor",)),
        (line(7.0, 20), Sensor("camera"), ("other_sensor", "too_large_for_model", "few_points")),
    ],
)
def test_reasons_of_a_scan(scan, sensor, expected):
    assert reasons_of_scan(scan, sensor, SETTINGS) == expected


@pytest.mark.parametrize(
    ("axes", "told"),
    [
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], False),
        ([[1, 0, 0], [0, -1, 0], [0, 0, -1]], True),  # OpenGL: y up, z backward
        ([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], True),  # ROS' body: x forward, y left, z up
        ([[0, 0, 1], [-1, 0, 0], [0, 1, 0]], True),  # z down: a little ahead, far beside
    ],
)
def test_a_camera_that_does_not_look_along_z_is_told_its_axes(axes, told):
    """All that was said of clouds with z up was a poor fit."""
    camera = dataclasses.replace(SETTINGS, sensor="camera")
    chair = np.random.default_rng(0).normal((0.8, 0.4, 4.0), 0.5, (64, 3))
    warning = warning_of((chair @ np.transpose(axes)).astype(np.float32), None, camera)
    assert ("x right, y down, z forward" in warning) == told
    assert bool(warning) == told


@pytest.mark.parametrize(
    ("cost", "confidence", "expected"),
    [
        (0.29, 0.11, ()),
        (0.31, 0.11, ("poor_fit",)),
        (0.29, 0.09, ("low_confidence",)),
        (0.31, 0.0, ("poor_fit", "low_confidence")),
    ],
)
def test_reasons_of_a_result(cost, confidence, expected):
    assert reasons_of_result(completion(cost, confidence), SETTINGS) == expected


@pytest.mark.parametrize(
    ("pose", "box", "kind", "expected"),
    [
        (0.9, 0.9, 0.9, ()),
        (0.7, 0.9, 0.7, ("low_confidence",)),
        (0.4, 0.9, 0.9, ("low_confidence", "unsure_heading")),
        (0.9, 0.4, 0.3, ("low_confidence", "unsure_box", "other_kind")),
    ],
)
def test_reasons_of_probabilities(pose, box, kind, expected):
    done = completion(0.1, pose * box * kind)
    done = dataclasses.replace(done, p_pose=pose, p_box=box, p_kind=kind)
    assert reasons_of_result(done, SETTINGS) == expected


@pytest.mark.parametrize(
    ("heights", "expected"),
    [
        ((1.41, 2.33, 1.46, 2.25, 1.44, 2.36, 1.41, 2.26), ("scans_disagree",)),  # car and van
        ((1.41, 1.45, 1.46, 1.52, 1.44, 1.38, 1.41, 2.26), ()),  # one went wrong
        ((1.41, 2.33, 1.46), ()),  # too few to tell
        ((3.2, 3.6, 3.2, 3.6, 3.2, 3.6), ()),  # a lorry: it is the share that counts
    ],
)
def test_a_track_of_two_vehicles_disagrees_on_its_height(heights, expected):
    done = completion(0.1, 0.9)
    each = [replace_height(done, height) for height in heights]
    assert reasons_of_track(each) == expected


def replace_height(done, height):
    """The same, so high."""
    box = dataclasses.replace(done.box, size=(*done.box.size[:2], height))
    return dataclasses.replace(done, box=box)


def test_a_track_keeps_what_speaks_against_the_scan():
    alone = dataclasses.replace(completion(0.4, 0.05), reasons=("few_points",))
    alone = judged(alone, None, None, SETTINGS)
    assert alone.reasons == ("few_points", "poor_fit", "low_confidence")
    for cost, expected in ((0.1, ("few_points",)), (0.4, ("few_points", "poor_fit"))):
        together = dataclasses.replace(alone, cost=cost, confidence=0.7)
        assert judged(together, None, None, SETTINGS).reasons == expected


def test_the_document_names_the_bounds_of_the_shipped_weights():
    settings, rule = load_checkpoint(SHIPPED)[1], ReasonRule()
    (low, high), (_, p90) = settings.extent_m, settings.cost_m
    text = (Path(__file__).parents[2] / "docs/formats.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(too_\w+|poor_fit)` .*: ([\d.]+) m", text, re.MULTILINE)
    warned = re.search(r"above ([\d.]+) m or below ([\d.]+) m", text)
    assert {name: float(bound) for name, bound in rows} == {
        "too_large_for_model": round(high, 1),
        "too_small_for_model": round(rule.smallest * low, 2),
        "poor_fit": round(rule.poor_fit * p90, 2),
    }
    assert warned
    assert float(warned[1]) == round(rule.largest * high, 1)
    assert float(warned[2]) == round(rule.smallest * low, 2)


def test_a_registration_says_what_is_wrong_with_either_scan_and_reaches_by_the_target():
    """5 % of the target's 1 m, whatever the source holds beside it."""
    sure = completion(0.1, 0.9)
    unsure = dataclasses.replace(sure, confidence=0.2, warning="odd", reasons=("poor_fit",))
    target, source = line(1.0), np.array([[8.5, 0.1, 0], [18, 0, 0]], np.float32)
    for done in ((sure, unsure), (unsure, sure)):
        found = registered(source, target, done)
        assert (found.confidence, found.warning, found.reasons) == (0.2, "odd", ("poor_fit",))
        assert found.inlier_ratio == 0


def test_a_predictor_flags_by_the_bounds_of_its_configuration():
    """Single scans, raw or not, and tracks, short or long."""
    scans = [np.load(Path(__file__).parents[2] / "examples" / "scan.npy").astype(np.float32)] * 3
    reasons = ReasonRule(few_points=10**6, poor_fit=0.0)
    for raw, key_scans in ((False, 2), (False, 3), (True, 3)):
        config = InferenceConfig(reasons=reasons, track=TrackConfig(key_scans=key_scans))
        model = load(raw=raw, config=config)
        for done in (*model.complete_many(scans), *model.complete_track(scans)):
            assert {"few_points", "poor_fit"} <= set(done.reasons)
