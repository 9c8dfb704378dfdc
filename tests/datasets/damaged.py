# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""What a reader says of a piece that is damaged while others are whole."""

import re

from wildshape.datasets.tracks.source import all_tracks


def passed_over(source, match):
    """Read all; one of the reasons for leaving something out must match."""
    tracks = list(all_tracks(source))
    assert any(re.search(match, reason) for reason in source.rejected), source.rejected
    assert not any("\n" in reason for reason in source.rejected)
    return tracks
