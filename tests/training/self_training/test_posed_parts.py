# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Tracks posed so far: found again after a stop, and only by the run that posed them."""

from contextlib import nullcontext

import pytest
import torch
from tests.packed import packed
from tests.training.self_training.taught import sampler_of

from wildshape.parallel.team import ALONE
from wildshape.training.self_training import posed_parts, pseudo_labels
from wildshape.training.self_training.posed_parts import PosedParts
from wildshape.training.self_training.pseudo_labels import fused_targets

IDENTITY = {"teacher": "abc"}


class StoppedError(Exception):
    """In the midst of posing."""


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Files of two tracks; all work is done by this process."""
    monkeypatch.setattr(posed_parts, "_TRACKS", 2)
    monkeypatch.setattr(pseudo_labels, "team", lambda: nullcontext(ALONE))


@pytest.fixture(scope="module")
def sampler(cars, tmp_path_factory):
    """Five tracks of four scans."""
    path = tmp_path_factory.mktemp("few") / "store"
    return sampler_of(packed(path, [car.part(range(4)) for car in cars[:5]]))


@pytest.fixture
def stopped(sampler, teacher, tmp_path):
    """The folder of a run that was stopped after three tracks."""

    def stop(done, _):
        if done == 3:
            raise StoppedError

    with pytest.raises(StoppedError):
        fused_targets(teacher, sampler, stop, parts=PosedParts(tmp_path, IDENTITY))
    return tmp_path


def test_a_stopped_run_poses_the_other_tracks_alone(
    sampler, teacher, stopped, tmp_path_factory, monkeypatch
):
    whole = PosedParts(tmp_path_factory.mktemp("whole"), IDENTITY)
    expected = fused_targets(teacher, sampler, parts=whole)
    posed, pose = [], pseudo_labels.posed_together
    monkeypatch.setattr(
        pseudo_labels, "posed_together", lambda *args: posed.append(args) or pose(*args)
    )
    parts = PosedParts(stopped, IDENTITY)
    found = fused_targets(teacher, sampler, parts=parts)
    assert len(posed) == 3
    for one, two in zip(found, expected, strict=True):
        assert torch.equal(torch.as_tensor(one), torch.as_tensor(two))
    parts.clear()
    assert not list(stopped.iterdir())


def test_parts_of_another_run_or_damaged_ones_are_not_taken(sampler, stopped):
    scans_of = sampler.scans_of
    assert len(PosedParts(stopped, IDENTITY).found(scans_of)) == 2
    assert not PosedParts(stopped, {"teacher": "other"}).found(scans_of)
    assert not PosedParts(stopped, IDENTITY).found([scans[1:] for scans in scans_of])
    only = next(stopped.iterdir())
    whole = only.read_bytes()
    for damaged in (whole[:-8], whole[:-8] + bytes([whole[-8] ^ 1]) + whole[-7:]):
        only.write_bytes(damaged)
        assert not PosedParts(stopped, IDENTITY).found(scans_of)
