# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What is left of a partly hidden scan is a part of it, without a strip or without its top."""

import math

import numpy as np
import torch

from wildshape.geometry.projection.field_of_view import slope
from wildshape.training.batches.occlusion_augmentation import OcclusionConfig, partly_hidden


def _wall(top: float) -> torch.Tensor:
    """A wall 8 m before the sensor, 4 m wide."""
    generator = torch.Generator().manual_seed(0)
    y, z = 4 * torch.rand(2000, generator=generator) - 2, torch.rand(2000, generator=generator)
    return torch.stack((torch.full_like(y, 8.0), y, -1.5 + (top + 1.5) * z), 1)


def _drawn(points: torch.Tensor, least: float = 0.05) -> list[torch.Tensor]:
    rngs, config = map(np.random.default_rng, range(200)), OcclusionConfig(least=least)
    return [partly_hidden(points, rng, config).points for rng in rngs]


def _wide_gaps(part: torch.Tensor) -> int:
    """Elevations between which there is no point for as long as between two beams."""
    return int((torch.rad2deg(torch.atan(slope(part))).unique().diff() > 0.35).sum())


def test_what_is_left_is_of_the_scan_and_as_many_points():
    points = _wall(1.0)
    known = {tuple(point) for point in points.tolist()}
    for part in _drawn(points):
        assert part.shape == points.shape
        assert {tuple(point) for point in part.tolist()} <= known


def test_what_is_hidden_is_of_the_scan_and_no_longer_seen():
    points, hidden = _wall(1.0), 0
    for seed in range(40):
        part = partly_hidden(points, np.random.default_rng(seed))
        seen, gone = ({tuple(p) for p in some.tolist()} for some in part)
        assert gone <= {tuple(point) for point in points.tolist()}
        assert not seen & gone
        hidden += len(gone) > 0
    assert 10 <= hidden <= 30


def test_a_fifth_of_the_scans_lack_a_strip_and_a_fifth_one_side():
    points = _wall(-0.2)  # below the horizon: no view ends on it
    azimuth = torch.atan2(points[:, 1], points[:, 0])
    ends, width = torch.stack((azimuth.min(), azimuth.max())), azimuth.max() - azimuth.min()
    lacking, sides = 0, [0, 0]
    for part in _drawn(points):
        left = torch.cat((torch.atan2(part[:, 1], part[:, 0]), ends)).sort().values
        gaps = left.diff() / width
        lacking += float(gaps.max()) > 0.05
        assert float(gaps.max()) < 0.75
        wide = gaps > 0.19
        sides[0] += bool(wide[0])
        sides[1] += bool(wide[-1])
        assert int((gaps > 0.04).sum()) <= 2  # a strip and a side
    assert 45 <= lacking <= 100
    assert min(sides) >= 12


def test_what_rises_above_the_horizon_is_cut_at_some_elevation():
    points = _wall(1.5)
    parts = _drawn(points)
    highest = torch.stack([slope(part).max() for part in parts])
    rings = torch.tensor([_wide_gaps(part) >= 3 for part in parts])
    cut = highest < slope(points).max() - 0.01
    assert 0.15 < float(cut.float().mean()) < 0.45
    assert float(highest[~rings].min()) > -0.01
    assert float(highest.min()) > -0.01 - math.tan(math.radians(2.2))  # the next ring below
    assert float(highest[cut].std()) > 0.03


def test_too_little_is_not_left():
    points = _wall(1.0)
    assert all(torch.equal(part, points) for part in _drawn(points, least=1.0))


def test_a_fifth_show_rings_alone_and_some_no_feet():
    points = _wall(-0.2)
    elevation = torch.rad2deg(torch.atan(slope(points)))
    highs, rings = [], 0
    for part in _drawn(points, least=0.008):
        seen = torch.rad2deg(torch.atan(slope(part))).unique()
        highs.append(float(seen.min() - elevation.min()))
        rings += _wide_gaps(part) >= 3
    assert 20 <= rings <= 60
    lifted = torch.tensor(highs) > 0.6 * 0.25 * float(elevation.max() - elevation.min())
    assert 4 <= int(lifted.sum()) <= 30


def test_what_lies_between_the_beams_is_not_hidden():
    """Of a scan thinned to rings, something hides points of rings alone."""
    points, checked = _wall(-0.2), 0
    config = OcclusionConfig(strip=1.0, side=0.0, top=0.0, feet=0.0, rings=1.0, least=0.001)
    for seed in range(10):
        seen, hidden = partly_hidden(points, np.random.default_rng(seed), config)
        both = torch.cat((seen, hidden))
        assert _wide_gaps(both) >= 3
        assert _wide_gaps(both) == _wide_gaps(seen)
        checked += len(hidden) > 20
    assert checked >= 5


def test_the_side_that_is_said_is_hidden():
    points = _wall(-0.2)
    for left, far in ((1.0, 1.0), (0.0, -1.0)):
        config = OcclusionConfig(strip=0.0, side=1.0, left=left, top=0.0, feet=0.0, rings=0.0)
        for seed in range(5):
            seen, hidden = partly_hidden(points, np.random.default_rng(seed), config)
            assert float((far * hidden[:, 1]).min()) >= float((far * seen[:, 1]).max()) - 0.05


def test_low_things_hide_what_is_low():
    points = _wall(-0.2)
    config = OcclusionConfig(strip=0.0, side=0.0, top=0.0, feet=1.0, rings=0.0)
    for seed in range(10):
        seen, hidden = partly_hidden(points, np.random.default_rng(seed), config)
        assert float(slope(hidden).max()) < float(slope(seen).min())


def test_objects_above_the_horizon_are_cut_low_more_often_than_high():
    """At the square of a share drawn evenly: on average at a third of what rises."""
    points = _wall(1.5)
    config = OcclusionConfig(strip=0.0, side=0.0, top=1.0, feet=0.0, rings=0.0)
    rngs, whole = map(np.random.default_rng, range(300)), float(slope(points).max())
    at = [float(slope(partly_hidden(points, rng, config).points).max()) / whole for rng in rngs]
    assert 0.28 < np.mean(at) < 0.4
