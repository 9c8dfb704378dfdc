# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""The numbers are SplitMix64's, depend on the counters alone, and look like chance."""

import pytest
import torch

from wildshape.geometry.transforms.rotation import rotation_angle, rotation_from_uniform
from wildshape.ops.counter_random import integers, random_bits, uniform

COUNT = 20_000


def at(step):
    return torch.tensor(step)


def splitmix64(state):
    """The published generator, number by number."""
    word = (1 << 64) - 1
    while True:
        state = (state + 0x9E3779B97F4A7C15) & word
        z = ((state ^ state >> 30) * 0xBF58476D1CE4E5B9) & word
        z = ((z ^ z >> 27) * 0x94D049BB133111EB) & word
        yield z ^ z >> 31


def first(state):
    return next(splitmix64(state))


@pytest.mark.parametrize(("seed", "process", "step"), [(0, 0, 0), (7, 3, 123_456), (2**40, 1, 1)])
def test_lanes_are_the_published_generator(seed, process, step):
    golden = 0x9E3779B97F4A7C15
    key = first(first(seed) + process - golden)
    stream = splitmix64(key + (step << 32) * golden)
    expected = [next(stream) >> 32 for _ in range(50)]
    assert random_bits(seed, process, at(step), 50).tolist() == expected


def test_the_generator_is_seeded_as_its_authors_say():
    stream = splitmix64(1234567)
    assert [next(stream) for _ in range(2)] == [6457827717110365317, 3203168211198807973]


def test_every_counter_matters_and_nothing_else():
    draw = random_bits(1, 2, at(3), 100)
    assert torch.equal(draw, random_bits(1, 2, at(3), 1000)[:100])
    for other in ((2, 2, 3), (1, 3, 3), (1, 2, 4)):
        assert not torch.equal(draw, random_bits(other[0], other[1], at(other[2]), 100))
    assert not torch.equal(random_bits(1, 2, at(0), 9), random_bits(2, 1, at(0), 9))


def test_moments_of_uniform_draws():
    draws = torch.cat([uniform(random_bits(5, 0, at(s), COUNT)) for s in range(10)]).double()
    assert 0 <= draws.min() < 1e-4
    assert 1 - 1e-4 < draws.max() < 1
    for power in (1, 2, 3):
        moment = (draws**power).mean()
        spread = (1 / (2 * power + 1) - 1 / (power + 1) ** 2) ** 0.5
        assert abs(moment - 1 / (power + 1)) < 4 * spread / len(draws) ** 0.5


@pytest.mark.parametrize("other", [(5, 0, 8), (5, 1, 7), (6, 0, 7)])
def test_neighbouring_steps_processes_and_seeds_are_independent(other):
    a = uniform(random_bits(5, 0, at(7), COUNT)).double()
    b = uniform(random_bits(other[0], other[1], at(other[2]), COUNT)).double()
    for lag in (0, 1, -1, 7):
        correlation = torch.corrcoef(torch.stack((a, b.roll(lag))))[0, 1]
        assert abs(correlation) < 4 / COUNT**0.5
    assert abs(torch.corrcoef(torch.stack((a[1:], a[:-1])))[0, 1]) < 4 / COUNT**0.5
    # All cells of the square are hit alike.
    hits = torch.bincount((a * 16).long() * 16 + (b * 16).long(), minlength=256).double()
    chi_squared = ((hits - COUNT / 256).square() / (COUNT / 256)).sum()
    assert abs(chi_squared - 255) < 5 * (2 * 255) ** 0.5


def test_one_lane_over_many_steps_is_as_even():
    draws = torch.stack([random_bits(0, 0, at(s), 2) for s in range(3000)])
    pairs = uniform(draws).double()
    assert abs(pairs.mean() - 0.5) < 4 * 0.29 / 6000**0.5
    assert abs(torch.corrcoef(pairs.T)[0, 1]) < 4 / 3000**0.5
    assert len(set(draws[:, 0].tolist())) > 2990


def test_integers_stay_below_their_end_and_are_even():
    bits = random_bits(3, 0, at(1), COUNT)
    for end in (1, 2, 7, 1000):
        found = torch.bincount(integers(bits, end), minlength=end)
        assert len(found) == end
        chi_squared = ((found - COUNT / end).square() / (COUNT / end)).sum()
        assert abs(chi_squared - (end - 1)) < 5 * (2 * end) ** 0.5
    ends = torch.arange(1, COUNT + 1)
    assert bool((integers(bits, ends) < ends).all())
    most = torch.tensor([0xFFFFFFFF])
    assert integers(most, 2**31).item() == 2**31 - 1
    assert float(uniform(most)) < 1


def test_rotations_are_spread_evenly_over_all_rotations():
    rotation = rotation_from_uniform(uniform(random_bits(9, 0, at(2), 3 * COUNT)).view(-1, 3))
    eye = torch.eye(3).expand_as(rotation)
    torch.testing.assert_close(rotation @ rotation.mT, eye, atol=1e-5, rtol=0)
    assert bool((torch.linalg.det(rotation) > 0).all())
    # Every entry of the matrix has mean 0 and variance 1/3; any vector goes anywhere.
    assert float(rotation.mean(0).abs().max()) < 4 * (1 / 3 / COUNT) ** 0.5
    torch.testing.assert_close(rotation.square().mean(0), eye[0] * 0 + 1 / 3, atol=0.01, rtol=0)
    # The angle's density is (1 - cos) / pi.
    angle = rotation_angle(rotation).double().sort().values
    expected = (angle - angle.sin()) / torch.pi
    steps = torch.arange(1, COUNT + 1) / COUNT
    assert float((expected - steps).abs().max()) < 1.63 / COUNT**0.5
