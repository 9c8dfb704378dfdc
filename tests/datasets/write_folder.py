# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A folder of tracks, as anybody may have one."""

from wildshape.io.tracks import write_track
from wildshape.simulate.generate import SimulationConfig, simulate_tracks


def picture_scene(root):
    """A simulated car; what the documentation shows."""
    config = SimulationConfig(tracks=1, scans=12, occlusion=0.0)
    (track,) = simulate_tracks(config, seed=6, workers=1)
    write_track(root / "car", track)
