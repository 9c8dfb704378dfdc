# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A track whose scans are of two vehicles, as a tracker that swaps identities makes it."""

from wildshape.inference.predictor import load
from wildshape.simulate.config import SimulationConfig
from wildshape.simulate.generate import simulate_tracks


def test_scans_of_a_car_and_a_van_are_said_to_disagree():
    """Together they were a box of neither, with a probability of 0.98."""
    van, _, car, *_ = simulate_tracks(SimulationConfig(tracks=4, scans=8), 5, workers=1)
    model = load()
    mixed = [scan for pair in zip(car.scans[:4], van.scans[:4]) for scan in pair]
    assert all("scans_disagree" in one.reasons for one in model.complete_track(mixed))
    for track in (van, car):
        own = model.complete_track(track.scans)
        assert not any("scans_disagree" in one.reasons for one in own)
