# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Every figure of a table against an independent slow implementation, and what must not matter."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.cars import drive_by, poses_of, shape_of
from tests.evaluation import naive
from tests.strategies import poses, rotations

from wildshape.evaluation.cases import turn_track
from wildshape.evaluation.metrics import completion_error, registration_error
from wildshape.evaluation.protocol import run
from wildshape.evaluation.summary import figures_of, summarise
from wildshape.geometry.transforms.se3 import SE3, stack


def parts(T):
    """Quaternion and translation of one transform, as lists."""
    return naive.quaternion(T.rotation.tolist()), T.translation.tolist()


clouds = st.integers(0, 2**32 - 1).map(
    lambda seed: np.random.default_rng(seed).normal(size=(seed % 13 + 1, 3)).astype(np.float32)
)


@settings(max_examples=40, deadline=None)
@given(clouds, clouds)
def test_completion_equals_three_loops(predicted, truth):
    error = completion_error(predicted, truth)
    want = naive.one_way(predicted.tolist(), truth.tolist())
    assert error.precision == pytest.approx(want, rel=1e-5, abs=1e-6)
    want = naive.one_way(truth.tolist(), predicted.tolist())
    assert error.coverage == pytest.approx(want, rel=1e-5, abs=1e-6)
    assert error.cd == error.precision + error.coverage
    # Exchanged clouds exchange the sides.
    assert completion_error(truth, predicted).precision == pytest.approx(error.coverage, rel=1e-5)


@settings(max_examples=60, deadline=None)
@given(poses(), poses(), poses())
def test_registration_equals_quaternions_in_loops(predicted, pose, middle):
    error = registration_error(stack([predicted]), stack([pose]), middle)
    plain, symmetric, translation = naive.registration(parts(predicted), parts(pose), parts(middle))
    assert float(error.rotation_deg) == pytest.approx(plain, abs=1e-4)
    assert float(error.rotation_sym_deg) == pytest.approx(symmetric, abs=1e-4)
    assert float(error.translation_m) == pytest.approx(translation, abs=1e-9)
    assert 0 <= float(error.rotation_sym_deg) <= float(error.rotation_deg) <= 180


@settings(max_examples=40, deadline=None)
@given(poses(), poses(), rotations, rotations)
def test_turning_both_scans_changes_no_error(pose, middle, turn_scan, turn_middle):
    """A method that follows its input is scored alike under all three protocols."""
    nowhere = torch.zeros(3, dtype=torch.float64)
    A, B = SE3(turn_scan, nowhere), SE3(turn_middle, nowhere)
    wrong = SE3(turn_scan, torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64))
    predicted = wrong @ middle @ pose.inverse()
    before = registration_error(stack([predicted]), stack([pose]), middle)
    turned = B @ predicted @ A.inverse()
    after = registration_error(stack([turned]), stack([A @ pose]), B @ middle)
    for name in ("rotation_deg", "rotation_sym_deg", "translation_m"):
        assert float(getattr(after, name)) == pytest.approx(float(getattr(before, name)), abs=1e-5)


class Wrong:
    """Completes by a shifted scan, registers by a rotation that is off; no luck involved."""

    def complete(self, points, sensor):
        return points[::7] + np.array([0.1, 0.05, 0], np.float32)

    def register_track(self, scans, sensor):
        generator = torch.Generator().manual_seed(len(scans))
        angle = torch.randn(len(scans), generator=generator).double()
        zero, one = torch.zeros_like(angle), torch.ones_like(angle)
        rows = (angle.cos(), -angle.sin(), zero, angle.sin(), angle.cos(), zero, zero, zero, one)
        return SE3(torch.stack(rows, dim=-1).reshape(-1, 3, 3), torch.zeros(len(scans), 3).double())


@pytest.mark.parametrize("rotate", ["none", "yaw", "so3"])
def test_a_whole_table_equals_loops_over_its_scans(rotate):
    tracks = [drive_by(f"t{i}", scans=3 + i, points=80, seed=i) for i in range(2)]
    tracks = [replace(t, shape=shape_of(t)[:150]) for t in tracks]
    runs = [run({"it": Wrong()}, tracks, rotate, seed) for seed in range(2)]
    expected = [loops(tracks, rotate, seed) for seed in range(2)]
    for found, want in zip(runs, expected, strict=True):
        figures = figures_of(found["it"])
        for name, value in want.items():
            assert figures[name] == pytest.approx(value, rel=1e-4, abs=1e-5), name
    summary = summarise(runs)[0]
    for name in expected[0]:
        values = [one[name] for one in expected]
        assert summary.mean[name] == pytest.approx(naive.mean(values), rel=1e-4, abs=1e-5)
        assert summary.std[name] == pytest.approx(naive.deviation(values), rel=1e-3, abs=1e-4)


def loops(tracks, rotate, seed):
    """The figures of `Wrong`, scan by scan."""
    sides, angles, symmetric, shifts = [], [], [], []
    for track in tracks:
        turned = turn_track(track, rotate, seed)
        pose = poses_of(turned)
        T = Wrong().register_track(turned.scans, turned.sensor)
        for i, scan in enumerate(turned.scans):
            # The truth is carried to the scan here, the prediction to the object there.
            truth = pose[i].apply_numpy(shape_of(turned)).tolist()
            cloud = Wrong().complete(scan, turned.sensor).tolist()
            sides.append((naive.one_way(cloud, truth), naive.one_way(truth, cloud)))
            if i == turned.middle:
                continue
            found = naive.registration(parts(T[i]), parts(pose[i]), parts(pose[turned.middle]))
            for values, value in zip((angles, symmetric, shifts), found, strict=True):
                values.append(value)
    return {
        "precision": naive.mean(a for a, _ in sides),
        "coverage": naive.mean(b for _, b in sides),
        "cd": naive.mean(a + b for a, b in sides),
        "acc30": naive.accuracy(angles),
        "acc30_sym": naive.accuracy(symmetric),
        "rot_median_deg": naive.median(angles),
        "rot_sym_median_deg": naive.median(symmetric),
        "trans_median_m": naive.median(shifts),
    }
