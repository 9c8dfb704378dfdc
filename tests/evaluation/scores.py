# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""Scores of a method, by hand."""

from wildshape.evaluation.metrics import CompletionError, RegistrationScore
from wildshape.evaluation.results import (
    CompletionScore,
    MethodScores,
    Skipped,
)


def completion(track, precision, coverage):
    partial = CompletionError(precision / 2, coverage / 2)
    error = CompletionError(precision, coverage)
    return CompletionScore(track, "0", error, partial, "mirrored", 100, 200, 0.05)


def scores(scale=1.0, name="ours"):
    return MethodScores(
        name,
        (completion("a", 0.1 * scale, 0.3 * scale), completion("b", 0.2 * scale, 0.2 * scale)),
        (
            RegistrationScore("a", "0", 30.0, 30.0, 0.1 * scale),
            RegistrationScore("a", "1", 170.0, 10.0, 0.2 * scale),
            RegistrationScore("b", "0", 40.0, 40.0, 0.6 * scale),
        ),
        (Skipped("a", "7", "all points equal"), Skipped("b", "3", "all points equal")),
    )
