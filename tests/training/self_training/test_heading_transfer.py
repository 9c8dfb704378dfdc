# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Views that come in no order look as weights of another sensor say."""

import numpy as np
import pytest
import torch
from tests.cars import poses_of
from tests.training.self_training.taught import NOT_KEPT, sampler_of

from wildshape.errors import BadInputError
from wildshape.geometry.transforms.se3 import SE3
from wildshape.inference.predictor import load
from wildshape.inference.tracks.heading_vote import half_turn
from wildshape.simulate.generate import SimulationConfig, simulate_tracks
from wildshape.training.self_training import pseudo_labels
from wildshape.training.self_training.heading_transfer import (
    _beside,
    check_transfer,
    transferred_signs,
)

VEHICLE_M = 5.0


def test_views_of_a_camera_look_as_a_lidar_s_weights_say():
    """Of views posed right but for half turns, those turned are found, in one way for all."""
    config = SimulationConfig(tracks=4, scans=6, sensor="depth-camera", shape_points=64)
    asked, rng, right = load(raw=True), np.random.default_rng(0), []
    for track in simulate_tracks(config, 5, workers=1):
        true = poses_of(track)
        true = SE3(true.rotation.double(), VEHICLE_M * true.translation.double())
        turned = torch.from_numpy(rng.random(len(track.scans)) < 0.5)
        posed = SE3(
            torch.where(turned[:, None, None], (true @ half_turn(0.0)).rotation, true.rotation),
            true.translation,
        )
        scans = [np.float32(VEHICLE_M) * scan for scan in track.scans]
        signs = transferred_signs(asked, scans, posed)
        right.append(torch.where(turned, -signs, signs))
    share = float((torch.cat(right) > 0).double().mean())
    assert max(share, 1 - share) >= 0.9


def test_a_view_is_put_where_a_lidar_would_stand():
    """On the same side, level, upright, looking at the object; also for a view from above."""
    sensors = torch.tensor(((3.0, 4.0, 2.0), (-1.0, 0.0, -5.0), (0.0, 0.0, 6.0))).double()
    T_lidar_can = _beside(sensors)
    place = T_lidar_can.inverse().translation
    torch.testing.assert_close(place[:, 2], torch.ones(3, dtype=torch.float64))
    assert bool((place[:2, :2] * sensors[:2, :2]).sum(-1).gt(0).all())
    middle = T_lidar_can.translation
    torch.testing.assert_close(middle[:, 1], torch.zeros(3, dtype=torch.float64))
    assert bool((middle[:, 0] > 0).all())
    torch.testing.assert_close(torch.linalg.det(T_lidar_can.rotation), torch.ones(3).double())
    up = torch.tensor((0.0, 0.0, 1.0), dtype=torch.float64).expand(3, 3)
    torch.testing.assert_close(T_lidar_can.rotation[:, :, 2], up)


def test_weights_of_a_camera_are_refused():
    with pytest.raises(BadInputError, match="LiDAR"):
        check_transfer(load("airplane"))


def test_targets_look_as_the_other_weights_say(car_store, teacher, monkeypatch):
    """Each scan by itself: every other one is said to be turned, and is."""
    asked = []

    def every_other(_other, scans, *_):
        asked.append(len(scans))
        return 1.0 - 2.0 * (torch.arange(len(scans)) % 2)

    def none(_other, scans, *_):
        return torch.ones(len(scans))

    monkeypatch.setattr(pseudo_labels, "refined", lambda _teacher, track: track)
    monkeypatch.setattr(pseudo_labels, "levelled", lambda track: track)
    sampler = sampler_of(car_store)
    monkeypatch.setattr(pseudo_labels, "transferred_signs", none)
    plain = pseudo_labels.fused_targets(teacher, sampler, headings=teacher, parts=NOT_KEPT)
    monkeypatch.setattr(pseudo_labels, "transferred_signs", every_other)
    turned = pseudo_labels.fused_targets(teacher, sampler, headings=teacher, parts=NOT_KEPT)
    assert asked == [len(scans) for scans in sampler.scans_of]
    first = torch.as_tensor(sampler.scans_of[0])
    cosine = (plain.rotation[first] * turned.rotation[first])[:, :, 0].sum(-1)
    torch.testing.assert_close(cosine, every_other(None, first))
