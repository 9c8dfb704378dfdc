# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Points that repeat others change neither code nor score, and are not computed again."""

import torch

from wildshape.geometry.projection.visibility import FacingBins
from wildshape.method.encoders.pcn import PCNEncoder
from wildshape.method.encoders.pcn_distinct import encode_distinct
from wildshape.method.hindsight import repeats, score_hypotheses

SIZES = torch.tensor([20, 64, 7])


def repeated(generator):
    clouds = [torch.randn(int(size), 3, generator=generator) for size in SIZES]
    return torch.stack([cloud[torch.arange(64) % len(cloud)] for cloud in clouds])


def test_the_code_of_each_is_that_of_all():
    torch.manual_seed(0)
    encoder, points = PCNEncoder((8, 16, 16, 32)), repeated(torch.Generator().manual_seed(1))
    whole = encoder(points).detach()
    torch.testing.assert_close(encode_distinct(encoder, points, SIZES), whole)
    points[0, 20:] = 99.0  # not looked at
    torch.testing.assert_close(encode_distinct(encoder, points, SIZES), whole)


def test_scores_count_points_as_often_as_they_are_there():
    generator = torch.Generator().manual_seed(2)
    scans, posed = repeated(generator), torch.randn(3, 2, 50, 3, generator=generator)
    centres = torch.tensor([10.0, 0, 0]).expand(3, 3)
    whole = score_hypotheses(scans, centres, posed, FacingBins(0.3))
    own = score_hypotheses(scans, centres, posed, FacingBins(0.3), SIZES)
    torch.testing.assert_close(own.observation, whole.observation)
    torch.testing.assert_close(own.projection, whole.projection)
    assert repeats(SIZES, 64).sum(1).tolist() == [64, 64, 64]
