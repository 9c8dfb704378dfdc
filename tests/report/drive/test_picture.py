# SPDX-FileCopyrightText: 2026 The Wildshape developers
# SPDX-License-Identifier: Apache-2.0
"""A drive from above."""

from tests.drives.finished_drive import FRAMES, finished_drive

from wildshape.report.drive.picture import picture_from_above


def test_names_are_drawn_as_they_are(tmp_path):
    """A track's `a$^$` ended drive in a traceback, and a Chinese name in warnings."""
    at = [(12.0, 3.5, 0.2)] * FRAMES
    odd = finished_drive(tmp_path / "odd", {"a$^$": at, "車": at})
    assert picture_from_above(odd, ())[8:12] == b"WEBP"
    first, other, part = (
        picture_from_above(finished_drive(tmp_path / f"{i}", {name: at}), ())
        for i, name in enumerate(("bus+1", "bus+2", "bus+b"))
    )
    assert first == other != part
