# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""All readers that are attacked."""

from tests.fuzz import drives, recordings, results, scans, weights

TARGETS = (
    *scans.TARGETS,
    *drives.TARGETS,
    *recordings.TARGETS,
    *results.TARGETS,
    *weights.TARGETS,
)
