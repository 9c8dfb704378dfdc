# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Which tracks of a training are held out."""

from dataclasses import replace

from tests.training.worker import SMALLEST

from wildshape.io.store.store import StoreWriter, open_store
from wildshape.training.loop import setup, split_tracks


def test_tracks_held_out_without_a_usable_scan_are_those_fitted(cars, tmp_path):
    held = split_tracks(20)[1]
    with StoreWriter(tmp_path / "store", {}) as writer:
        for number in range(20):
            track = replace(cars[number % len(cars)], name=f"{number}")
            few = tuple(scan[:20] for scan in track.scans)
            writer.add(replace(track, scans=few) if number in held else track)
    recipe = replace(SMALLEST, held_out=20)
    said = []
    run = setup(recipe, open_store(tmp_path / "store"), tmp_path / "run", say=said.append)
    assert sorted(run.held_tracks) == [i for i in range(20) if i not in held]
    assert "none is held out: validation measures what was trained on" in said[0]


def test_few_tracks_are_both_fitted_and_held_out_many_are_not():
    fitted, held = split_tracks(8)
    assert sorted(fitted) == sorted(held) == list(range(8))
    fitted, held = split_tracks(100)
    assert len(held) == 5
    assert sorted([*fitted, *held]) == list(range(100))
    assert list(split_tracks(100)[1]) == list(held)


def test_tracks_that_are_held_out_are_not_fitted(car_store, tmp_path):
    said = []
    run = setup(replace(SMALLEST, held_out=4), car_store, tmp_path / "many", say=said.append)
    assert not said
    setup(replace(SMALLEST, held_out=9), car_store, tmp_path / "few", say=said.append)
    assert "none is held out" in said[0]
    fitted, held = (
        {int(scan) for scans in sampler.scans_of for scan in scans}
        for sampler in (run.sampler, run.held_out)
    )
    assert not fitted & held
    assert len(run.held_out.scans_of) == 2
    assert fitted | held == set(range(car_store.scan_count))
